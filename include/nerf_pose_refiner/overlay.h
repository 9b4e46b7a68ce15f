// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/object.h"
#include "nerf_pose_refiner/observation.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

class Backend;

/// Draws an object into camera images. Not thread-safe.
class Overlay {
 public:
  Overlay(std::shared_ptr<Backend> backend, const Object& object);
  ~Overlay();
  Overlay(Overlay&&) noexcept;
  Overlay& operator=(Overlay&&) noexcept;

  /// Draws the image in grey, over it the object in colour at a pose, and its outline in green.
  /// @param T_C_O the object in the camera's optical frame [m; model units if it has no scale].
  /// @param opacity of the rendering, 0..1; 0 draws only the outline.
  /// @return RGB image of the observation's size.
  /// @throws std::invalid_argument for an invalid image, pose or opacity.
  Image8 draw(const Observation& observation, const Pose& T_C_O, double opacity = 1);

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace nerf_pose_refiner
