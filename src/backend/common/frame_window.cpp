// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cmath>

#include "backend/keyframe_aligner.h"

namespace nerf_pose_refiner {

int frameLevelFor(const KeyframePoints& keyframe, const Camera& camera, const Pose& T_O_C) {
  const auto pixel_width = [&keyframe](const Camera& of, const Pose& pose) {
    return (pose.t - keyframe.centre).norm() / of.fx;
  };
  const double ratio = keyframe.reduction * pixel_width(keyframe.camera, keyframe.T_O_C) /
                       pixel_width(camera, T_O_C);
  constexpr double kMaxLevel = 30;  // pyramids end before that
  return static_cast<int>(std::lround(std::clamp(std::log2(ratio), -kMaxLevel, kMaxLevel)));
}

FrameWindow frameWindowFor(const KeyframePoints& keyframe, const Camera& camera, const Pose& T_O_C,
                           double margin) {
  FrameWindow window;
  window.levels = static_cast<int>(keyframe.levels.size());
  const int finest = frameLevelFor(keyframe, camera, T_O_C);
  window.finest = std::max(0, finest);
  while (window.finest > 0 && std::min(camera.width, camera.height) >> (window.finest + 1) < 1) {
    --window.finest;  // the object is so near that a pixel of the keyframe covers the image
  }
  window.levels = std::max(1, window.levels + std::min(0, finest));
  while (window.levels > 1 &&
         std::min(camera.width, camera.height) >> (window.finest + window.levels) < 1) {
    --window.levels;  // two pixels of the coarsest level at least
  }
  window.pixels = {0, 0, camera.width, camera.height};
  const Eigen::Vector3d centre_C = T_O_C.inverse() * keyframe.centre;
  const double reach = (0.5 + margin) * keyframe.diameter;
  if (!(centre_C.z() > reach)) return window;
  const Eigen::Vector2d low = camera.project(centre_C - Eigen::Vector3d(reach, reach, 0));
  const Eigen::Vector2d high = camera.project(centre_C + Eigen::Vector3d(reach, reach, 0));
  const auto inside = [](double u, int size) {
    return static_cast<int>(std::clamp(u, 0.0, static_cast<double>(size - 1)));
  };
  window.pixels.x = inside(low.x(), camera.width);
  window.pixels.y = inside(low.y(), camera.height);
  window.pixels.width = inside(high.x(), camera.width) + 1 - window.pixels.x;
  window.pixels.height = inside(high.y(), camera.height) + 1 - window.pixels.y;
  return window;
}

}  // namespace nerf_pose_refiner
