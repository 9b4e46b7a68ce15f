// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "nerf_pose_refiner/observation.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// An image of several objects, and where the camera is for each of them.
struct ObjectScene {
  Observation observation;
  std::vector<Pose> T_O_C;
};

/// Puts views of objects side by side before a photo.
class SceneComposer {
 public:
  /// @param data a transforms.json for each object. @param width, height of the images [px].
  SceneComposer(const std::vector<std::string>& data, std::vector<std::string> photos, int width,
                int height);

  std::size_t objects() const { return views_.size(); }

  /// The views of a number.
  ObjectScene compose(std::size_t number) const;

 private:
  const PosedView& viewOf(std::size_t object, std::size_t number) const;

  std::vector<std::vector<PosedView>> views_;  // object by object
  std::vector<std::string> photos_;
  int width_, height_;
};

}  // namespace nerf_pose_refiner
