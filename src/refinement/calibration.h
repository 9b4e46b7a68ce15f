// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// What one camera alone shows of an object: SideViewReport, or RefineResult of a single image.
struct CameraSighting {
  Pose T_V_O;  ///< the object in the camera [m]
  /// Of T_V_O: position, then rotation, along and about the camera's axes [m^2, rad^2].
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Identity();
};

/// What the cameras of a rig show of one object at one moment, by their numbers; nothing: a camera
/// did not see it.
using RigSighting = std::vector<std::optional<CameraSighting>>;

/// A camera's place in the first camera of its rig.
struct CameraCalibration {
  bool success = false;  ///< there were enough poses, and they agree
  std::string message;   ///< what is missing, or wrong
  Pose T_C_V;            ///< refined [m]; in directions that were not seen, as it was stated
  /// Of T_C_V: position, then rotation, along and about the axes of the first camera [m^2, rad^2].
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  std::vector<std::string> unseen;  ///< directions that the poses do not fix, in words
  int sightings = 0;                ///< that were used
  double misfit = 0;  ///< root mean square of what is left [standard deviations], 1: as told
};

/// How a camera is calibrated.
struct CalibrationSettings {
  int min_sightings = 20;             ///< >= 1
  double position_goal_m = 0.0005;    ///< a direction is seen if it is known so well, > 0
  double rotation_goal_rad = 0.0009;  ///< alike, > 0
};

/// Refines the place of one camera of a rig from an object that several of its cameras saw, in
/// poses that are spread over the rig's space. What the other cameras show is joined with the
/// places that are stated for them.
/// @param T_C_V places of all cameras in the first one, as stated [m]; the first one's is the
/// identity. @param camera the number of the one to refine, 1 or more.
/// @throws std::invalid_argument for numbers that make no sense.
CameraCalibration calibrateCamera(const std::vector<RigSighting>& sightings,
                                  const std::vector<Pose>& T_C_V, std::size_t camera,
                                  const CalibrationSettings& settings = {});

}  // namespace nerf_pose_refiner
