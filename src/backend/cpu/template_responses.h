// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "math/template_placement.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// How strongly an image responds to an edge of each orientation at each pixel, 0..kMaxResponse:
/// much where the orientation of its gradient is that of the edge, in this pixel or one beside it;
/// nothing where there is no gradient, and where gradients of all orientations are close together,
/// as they are in a texture. To a place without an edge it responds where there is no gradient. The
/// light's strength and the background's do not matter.
struct OrientationResponses {
  int width = 0, height = 0;
  std::vector<std::uint8_t> values;  ///< [kTemplateBins][height][width]

  const std::uint8_t* plane(int bin) const {
    return values.data() + static_cast<std::size_t>(bin) * width * height;
  }
};

/// @param image [h][w][3]
OrientationResponses orientationResponses(const Image& image);

/// Responses in the order in which positions at every `stride`-th pixel read them: for each
/// orientation and place between two positions, what the positions of a row see is in a row
/// (Hinterstoisser et al. 2012, "linearised memories"; @see ResponseOrder). Around the image
/// nothing is seen.
class ResponseMemory {
 public:
  /// @param stride >= 1 [px]. @param margin around the image, a multiple of `stride`, >= 0 [px].
  ResponseMemory(const OrientationResponses& responses, int stride, int margin);

  const ResponseOrder& order() const { return order_; }

  /// The place of a position of the image; (0, 0) is its first pixel.
  const std::uint8_t* place(int column, int row) const {
    return values_.data() + order_.placeOf(column, row);
  }

 private:
  ResponseOrder order_;
  std::vector<std::uint8_t> values_;
};

}  // namespace nerf_pose_refiner
