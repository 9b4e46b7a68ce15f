// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/engine/observation.h"

#include <cmath>
#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {
namespace {

void requireImage(const char* name, const Image& image, const Camera& camera, int channels) {
  const auto size = [](int width, int height, int depth) {
    return std::to_string(width) + " x " + std::to_string(height) + " x " + std::to_string(depth);
  };
  const std::size_t values = image.pixels() * static_cast<std::size_t>(image.channels);
  if (image.width != camera.width || image.height != camera.height || image.channels != channels ||
      image.values.size() != values) {
    throw std::invalid_argument(std::string("Observation::") + name + " is " +
                                size(image.width, image.height, image.channels) +
                                ", the camera and its meaning ask for " +
                                size(camera.width, camera.height, channels));
  }
  for (float value : image.values) {
    if (!std::isfinite(value)) {
      throw std::invalid_argument(std::string("Observation::") + name + " is not finite");
    }
  }
}

}  // namespace

void Observation::validate() const {
  camera.validate();
  requireImage("image", image, camera, 3);
  const bool needs_alpha = background == Background::kKnownAlpha || background == Background::kMask;
  if (needs_alpha || !alpha.empty()) requireImage("alpha", alpha, camera, 1);
  if (!weight.empty()) requireImage("weight", weight, camera, 1);
  if (background == Background::kKnownColour && !background_colour.allFinite()) {
    throw std::invalid_argument("Observation::background_colour is not finite");
  }
}

}  // namespace nerf_pose_refiner
