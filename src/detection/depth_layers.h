// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>
#include <utility>

#include "field/field.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/depth.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// An image without what a depth camera sees before and behind a distance, and without the table
/// that an object may stand on: what is looked for there stands alone, and has its outline even
/// where it looks like what is behind it.
class DepthLayers {
 public:
  /// What of an image may show the object.
  struct Layer {
    PixelWindow window;  ///< of the image
    Image colours;       ///< of the window, [h][w][3]; what is elsewhere has one colour
  };

  /// @param camera of a part of the colour image. @param object has a metric scale, or there are no
  /// layers. @return nothing: too little is measured.
  static std::optional<DepthLayers> of(const DepthImage& depth, const Camera& camera,
                                       const FieldMetadata& object);

  /// Where depth shows something that may be the surface of an object at about a distance. What is
  /// not known, at the border of the depth image say, is not shown.
  /// @param colours [h][w][3] of the camera. @param distance of the object's centre [diameters].
  /// @param reach it may be so many times nearer or farther.
  /// @return nothing: there is no such place.
  std::optional<Layer> at(double distance, double reach, const Image& colours) const;

 private:
  DepthLayers(ImageOf<float> metres, const Camera& camera, double diameter_m)
      : metres_(std::move(metres)), camera_(camera), diameter_m_(diameter_m) {}

  ImageOf<float>
      metres_;  // at which a template would look as large as what a pixel sees; 0: unknown
  Camera camera_;
  double diameter_m_;
};

}  // namespace nerf_pose_refiner
