// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "refinement/calibration.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// What each camera of a rig saw by itself.
/// @param numbers of the cameras of the first side views; the observation's own camera has 0.
/// @param cameras how many there are.
RigSighting sightingOf(const Refinement& found, const FieldMetadata& object,
                       const std::vector<std::size_t>& numbers, std::size_t cameras);

/// What the cameras of a rig saw of an object, in poses that are spread over space. Not
/// thread-safe.
class SightingLog {
 public:
  /// Keeps a sighting in which two cameras or more saw the object, if it is from a pose unlike
  /// those that are kept.
  /// @param T_C_V places of all cameras in the first one, as stated [m]. If they are others than
  /// before, what was kept is forgotten: the rig was changed, or moves in itself.
  /// @param diameter_m of the object.
  void add(const RigSighting& sighting, const std::vector<Pose>& T_C_V, double diameter_m);

  /// @throws as calibrateCamera.
  CameraCalibration calibrate(std::size_t camera, const CalibrationSettings& settings) const {
    return calibrateCamera(kept_, T_C_V_, camera, settings);
  }

  std::size_t size() const { return kept_.size(); }
  /// Places of the cameras; empty: nothing was kept yet.
  const std::vector<Pose>& places() const { return T_C_V_; }
  void clear() {
    kept_.clear();
    poses_.clear();
  }

 private:
  std::vector<RigSighting> kept_;
  std::vector<Pose> poses_;  // T_C_O of each
  std::vector<Pose> T_C_V_;
};

}  // namespace nerf_pose_refiner
