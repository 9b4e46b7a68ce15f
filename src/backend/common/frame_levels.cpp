// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/frame_levels.h"

#include <algorithm>
#include <stdexcept>
#include <utility>

namespace nerf_pose_refiner {
namespace {

constexpr int kMinPixels = 2;  // of a level, for interpolation

// Whole steps that cover a range as far as [0, size) has whole steps: first and number of pixels.
std::pair<int, int> wholeSteps(int first, int count, int size, int step) {
  const int most = size / step;
  const int begin = std::clamp(first / step, 0, most - kMinPixels);
  const int end = std::clamp((first + count + step - 1) / step, begin + kMinPixels, most);
  return {begin * step, (end - begin) * step};
}

}  // namespace

FrameLevels::FrameLevels(const Observation& observation, const FrameWindow& window)
    : camera_(observation.camera), finest_(window.finest), count_(window.levels) {
  const int step = 1 << (finest_ + count_ - 1);
  if (std::min(camera_.width, camera_.height) < kMinPixels * step) {
    throw std::invalid_argument("alignment to a keyframe needs a larger image");
  }
  const auto [x, width] = wholeSteps(window.pixels.x, window.pixels.width, camera_.width, step);
  const auto [y, height] = wholeSteps(window.pixels.y, window.pixels.height, camera_.height, step);
  window_ = {x, y, width, height};
}

Pinhole<float> FrameLevels::intrinsics(int level) const {
  const int reduction = 1 << finest_;
  const Pinhole<double> K = {camera_.fx / reduction, camera_.fy / reduction,
                             (camera_.cx - window_.x + 0.5) / reduction - 0.5,
                             (camera_.cy - window_.y + 0.5) / reduction - 0.5};
  const double scale = 1.0 / (1 << (level - finest_));
  return {static_cast<float>(scale * K.fx), static_cast<float>(scale * K.fy),
          static_cast<float>(scale * (K.cx + 0.5) - 0.5),
          static_cast<float>(scale * (K.cy + 0.5) - 0.5)};
}

}  // namespace nerf_pose_refiner
