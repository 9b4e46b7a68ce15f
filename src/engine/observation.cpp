// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/engine/observation.h"

#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {
namespace {

constexpr float kTolerance = 1e-4f;  // of the range 0..1: rounding of a blend or a resampling

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
    if (!(value >= -kTolerance && value <= 1 + kTolerance)) {
      throw std::invalid_argument(std::string("Observation::") + name + " holds " +
                                  std::to_string(value) + ", must be in 0..1");
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
  const auto colour = background_colour.array();
  if (background == Background::kKnownColour && !((colour >= 0) && (colour <= 1)).all()) {
    throw std::invalid_argument("Observation::background_colour is not in 0..1");
  }
}

}  // namespace nerf_pose_refiner
