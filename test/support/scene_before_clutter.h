// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "evaluation/clutter.h"
#include "support/analytic_scene.h"

namespace nerf_pose_refiner {

/// An image of a scene as a camera sees it, before clutter that nobody learned.
/// @param gain of the light on the scene.
inline Observation sceneBeforeClutter(const LoadedField& scene, const Camera& camera,
                                      const Pose& T_O_C, float gain = 1) {
  const Observation seen = observeScene(scene, camera, T_O_C);
  Observation observation;
  observation.camera = camera;
  observation.image = clutter(camera.width, camera.height, 7);
  for (std::size_t i = 0; i < seen.alpha.values.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      float& value = observation.image.values[3 * i + c];
      value = gain * seen.image.values[3 * i + c] + (1 - seen.alpha.values[i]) * value;
    }
  }
  return observation;
}

}  // namespace nerf_pose_refiner
