// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/image_channels.h"

#include <stdexcept>

namespace nerf_pose_refiner {

void requireView(const View& view) {
  view.camera.validate();
  if (!view.T_O_C.isFinite()) throw std::invalid_argument("render: the pose is not finite");
}

Rendering unpacked(const Camera& camera, const float* pixels, const Eigen::Vector3f& centre) {
  Rendering rendering;
  rendering.colour = Image(camera.width, camera.height, 3);
  rendering.alpha = Image(camera.width, camera.height, 1);
  rendering.point = Image(camera.width, camera.height, 3);
  for (std::size_t i = 0; i < rendering.alpha.pixels(); ++i) {
    const float* pixel = pixels + kImageChannels * i;
    rendering.alpha.values[i] = pixel[kOpacity];
    for (int c = 0; c < 3; ++c) {
      rendering.colour.values[3 * i + c] = pixel[c];
      rendering.point.values[3 * i + c] = pixel[kPoint + c] + pixel[kOpacity] * centre[c];
    }
  }
  return rendering;
}

}  // namespace nerf_pose_refiner
