// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/observation.h"

#include <cstdint>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>

namespace nerf_pose_refiner {

Observation observe(Image8 rgb, const Camera& camera, const Image8& mask) {
  if (rgb.channels != 3) {
    throw std::invalid_argument("observe: the image has " + std::to_string(rgb.channels) +
                                " channels, must have 3 (RGB)");
  }
  const auto kept = std::make_shared<const Image8>(std::move(rgb));
  return observe(viewOf(*kept), PixelFormat::kRgb, camera, kept, mask);
}

Observation observe(const Image8View& bytes, PixelFormat format, const Camera& camera,
                    std::shared_ptr<const void> owner, const Image8& mask) {
  Observation observation;
  observation.pixels = std::make_shared<CameraPixels>(bytes, format, std::move(owner));
  observation.camera = camera;
  if (!mask.empty()) {
    if (mask.channels != 1) throw std::invalid_argument("observe: a mask has one channel");
    observation.background = Background::kMask;
    observation.alpha.width = mask.width;
    observation.alpha.height = mask.height;
    observation.alpha.channels = 1;
    for (const std::uint8_t value : mask.values) {
      observation.alpha.values.push_back(value != 0 ? 1.0f : 0.0f);
    }
  }
  observation.validate();
  return observation;
}

Observation observe(std::shared_ptr<const DepthImage> depth) {
  if (!depth) throw std::invalid_argument("observe: there is no depth image");
  if (!(depth->T_C_D.R.isIdentity() && depth->T_C_D.t.isZero())) {
    throw std::invalid_argument(
        "observe: a depth image alone is placed in no other camera (T_C_D)");
  }
  Observation observation;
  observation.camera = depth->camera;
  observation.depth = std::move(depth);
  observation.validate();
  return observation;
}

}  // namespace nerf_pose_refiner
