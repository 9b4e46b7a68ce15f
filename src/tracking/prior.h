// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "field/field.h"
#include "nerf_pose_refiner/track_status.h"
#include "refinement/field_refiner.h"
#include "tracking/settings.h"
#include "tracking/timed_pose.h"

namespace nerf_pose_refiner {

/// A start pose as the refiner has it.
///
/// Two standard deviations of the worst direction in the start's covariance give the width of the
/// search: carried over to the object's centre, about which it turns, and without turns that change
/// nothing. Where they are zero, the settings say how wide.
/// @param T_C_U where it is for the camera, at the image's time [m].
/// @throws InputError (kPriorBadCovariance) for a width that asks for the impossible.
Prior priorFrom(const TimedPose& start, const Pose& T_C_U, const FieldMetadata& object,
                const SearchSettings& settings);

/// Why a refined pose is not trusted.
struct Judgement {
  TrackReason reason = TrackReason::kNone;  ///< kNone: it is trusted
  std::string message;

  bool trusted() const { return reason == TrackReason::kNone; }
};

/// @param tracked the refinement began with the pose of the image before: the lower threshold
/// holds.
Judgement judge(const Refinement& refinement, bool tracked, const TrackingRules& rules);

}  // namespace nerf_pose_refiner
