// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/ros/prior.h"

#include <algorithm>
#include <cmath>

#include "nerf_pose_refiner/field/object_frame.h"
#include "nerf_pose_refiner/ros/input_error.h"

namespace nerf_pose_refiner {

using Status = RefinementStatus;

Prior priorFrom(const StartPose& start, const Pose& T_C_U, const FieldMetadata& object,
                const SearchSettings& settings) {
  Prior prior;
  prior.T_O_C = ObjectFrame::inMetres(object).cameraInModel(T_C_U);
  prior.rotation_rad = settings.rotation_deg * M_PI / 180;
  prior.translation = settings.translation;
  if (start.rotation_rad > 0) prior.rotation_rad = std::min(start.rotation_rad, M_PI);
  if (start.translation_m > 0) {
    prior.translation = start.translation_m / (object.metres_per_unit * object.diameter);
  }
  try {
    prior.validate();
  } catch (const std::invalid_argument& e) {
    throw InputError(Status::REASON_PRIOR_BAD_COVARIANCE,
                     std::string("the covariance asks for too wide a search: ") + e.what());
  }
  return prior;
}

Verdict verdictOn(const Refinement& refinement, bool tracked, const TrackingRules& rules) {
  switch (refinement.outcome) {
    case Outcome::kNoOverlap:
      return {Status::REASON_NO_OVERLAP, "the start pose lies outside of the image"};
    case Outcome::kDiverged:
      return {Status::REASON_DIVERGED, "no hypothesis survived"};
    case Outcome::kStopped:
      return {Status::REASON_STOPPED, "the refinement was interrupted"};
    case Outcome::kRefined:
      break;
  }
  if (refinement.score >= (tracked ? rules.min_score : rules.trust_score)) {
    return {Status::REASON_NONE, ""};
  }
  return {Status::REASON_LOW_SCORE, std::string("the pose explains the image badly (~tracker/") +
                                        (tracked ? "min_score)" : "trust_score)")};
}

}  // namespace nerf_pose_refiner
