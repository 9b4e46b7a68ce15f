// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/observation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <string>

#include "math/require.h"

namespace nerf_pose_refiner {
namespace {

constexpr float kTolerance = 1e-4f;  // rounding of a blend or a resampling
constexpr float kMin = -kTolerance, kMax = 1 + kTolerance;

// Width, height, channels.
using Size = std::array<int, 3>;

void requireSize(const char* name, const Size& size, const Size& wanted) {
  if (size == wanted) return;
  const auto text = [](const Size& of) {
    return std::to_string(of[0]) + " x " + std::to_string(of[1]) + " x " + std::to_string(of[2]);
  };
  throw std::invalid_argument(std::string("Observation::") + name + " is " + text(size) +
                              ", the camera and its meaning ask for " + text(wanted));
}

void requireImage(const char* name, const Image& image, const Camera& camera, int channels) {
  requireSize(name, {image.width, image.height, image.channels},
              {camera.width, camera.height, channels});
  const std::size_t values = image.pixels() * static_cast<std::size_t>(image.channels);
  if (image.values.size() != values) {
    throw std::invalid_argument(std::string("Observation::") + name + " holds " +
                                std::to_string(image.values.size()) + " values, must hold " +
                                std::to_string(values));
  }
  // Counted, without a way out of the loop: so many are compared at a time.
  std::size_t inside = 0;
  constexpr std::size_t kBlock = 4096;
  for (std::size_t first = 0; first < values; first += kBlock) {
    int in_block = 0;
    for (std::size_t i = first; i < std::min(values, first + kBlock); ++i) {
      in_block += (image.values[i] >= kMin) & (image.values[i] <= kMax);
    }
    inside += in_block;
  }
  if (inside == values) return;
  const float wrong = *std::find_if(image.values.begin(), image.values.end(),
                                    [](float value) { return !(value >= kMin && value <= kMax); });
  throw std::invalid_argument(std::string("Observation::") + name + " holds " +
                              std::to_string(wrong) + ", must be in 0..1");
}

void validateSideView(const SideView& view) {
  if (view.observation == nullptr || !view.observation->side_views.empty()) {
    throw std::invalid_argument("a side view has no observation, or one with side views");
  }
  if (view.observation->depth) {
    throw std::invalid_argument(
        "a side view has depth: give it to the observation, with its T_C_D");
  }
  view.observation->validate();
  if (!view.T_C_V.isFinite() || !view.T_C_V.isRigid()) {
    throw std::invalid_argument("SideView::T_C_V is not a rigid transform");
  }
  require(view.position_dev_m >= 0 && std::isfinite(view.position_dev_m),
          "SideView::position_dev_m", view.position_dev_m, "0 or more");
  require(view.rotation_dev_rad >= 0 && std::isfinite(view.rotation_dev_rad),
          "SideView::rotation_dev_rad", view.rotation_dev_rad, "0 or more");
  require(std::isfinite(view.after_s), "SideView::after_s", view.after_s, "finite");
}

}  // namespace

void Observation::validate() const {
  camera.validate();
  if (isDepthAlone()) {
    if (background != Background::kUnknown || !side_views.empty() || !boxes.empty()) {
      throw std::invalid_argument(
          "Observation has depth alone, which takes neither a background nor boxes nor side views; "
          "or its image is missing");
    }
    const bool is_own =
        depth->camera == camera && depth->T_C_D.R.isIdentity() && depth->T_C_D.t.isZero();
    if (!is_own) {
      throw std::invalid_argument(
          "Observation has depth alone of another camera than its own; or its image is missing");
    }
  } else if (pixels == nullptr) {
    requireImage("image", image, camera, 3);
  } else if (!image.empty()) {
    throw std::invalid_argument("Observation has an image and pixels: one of them must be empty");
  } else {
    requireSize("pixels", {pixels->width(), pixels->height(), 3}, {camera.width, camera.height, 3});
  }
  const bool needs_alpha = background == Background::kKnownAlpha || background == Background::kMask;
  if (needs_alpha || !alpha.empty()) requireImage("alpha", alpha, camera, 1);
  if (!weight.empty()) requireImage("weight", weight, camera, 1);
  for (const ImageBox& box : boxes) {
    const bool is_finite = std::isfinite(box.x_min) && std::isfinite(box.y_min) &&
                           std::isfinite(box.x_max) && std::isfinite(box.y_max);
    if (!is_finite || !(box.x_min < box.x_max && box.y_min < box.y_max)) {
      throw std::invalid_argument("Observation::boxes: a box is empty or not finite");
    }
  }
  if (depth) depth->validate();
  for (const SideView& view : side_views) validateSideView(view);
  if (T_W_C && !(T_W_C->isFinite() && T_W_C->isRigid())) {
    throw std::invalid_argument("Observation::T_W_C is not a rigid transform");
  }
  const auto colour = background_colour.array();
  if (background == Background::kKnownColour && !((colour >= 0) && (colour <= 1)).all()) {
    throw std::invalid_argument("Observation::background_colour is not in 0..1");
  }
}

}  // namespace nerf_pose_refiner
