// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "field/field.h"
#include "refinement/refiner.h"
#include "ros/conversions/parameters.h"
#include "ros/nodelet/tracker_state.h"

namespace nerf_pose_refiner {

/// A start pose as the library has it.
///
/// Two standard deviations of the worst direction in the start's covariance give the width of the
/// search: carried over to the object's centre, about which it turns, and without turns that change
/// nothing. Where they are zero, the settings say how wide.
/// @param T_C_U where it is for the camera, at the image's time [m].
/// @throws InputError (REASON_PRIOR_BAD_COVARIANCE) for a width that asks for the impossible.
Prior priorFrom(const InitialPose& start, const Pose& T_C_U, const FieldMetadata& object,
                const SearchSettings& settings);

/// Whether a refined pose is to be trusted.
struct TrustVerdict {
  std::uint8_t reason;  ///< RefinementStatus::REASON_NONE: it is; else why not
  std::string message;
};

/// @param tracked it began with the pose of the image before: the lower threshold holds.
TrustVerdict checkTrust(const Refinement& refinement, bool tracked, const TrackingRules& rules);

}  // namespace nerf_pose_refiner
