// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "field/field.h"
#include "refinement/field_refiner.h"
#include "tracking/settings.h"
#include "tracking/status.h"
#include "tracking/timed_pose.h"

namespace nerf_pose_refiner {

/// Converts a start pose to the prior of a refinement.
///
/// The half width of the search is two standard deviations along the largest axis of the start's
/// covariance, which is first transferred to the object's centre and reduced by rotations about an
/// axis of symmetry. Where it is zero, the width of the settings applies.
/// @param T_C_U the start pose in the camera, at the image's time [m].
/// @throws InputError (kPriorBadCovariance) if the width is too large.
Prior priorFrom(const TimedPose& start, const Pose& T_C_U, const FieldMetadata& object,
                const SearchSettings& settings);

/// Whether a refined pose is trusted, and why not.
struct Judgement {
  TrackReason reason = TrackReason::kNone;  ///< kNone: it is trusted
  std::string message;
  bool goes_on = false;   ///< not trusted, but good enough to go on from
  bool doubtful = false;  ///< of these: for a while, because it may be the wrong place

  bool trusted() const { return reason == TrackReason::kNone; }
};

/// Decides whether a refined pose is trusted.
/// @param confirmed a pose of the track that goes on was trusted before: the lower threshold holds.
Judgement judge(const Refinement& refinement, bool confirmed, const TrackingRules& rules);

}  // namespace nerf_pose_refiner
