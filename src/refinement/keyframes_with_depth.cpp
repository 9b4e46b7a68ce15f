// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <utility>

#include "refinement/depth_occlusion.h"
#include "refinement/keyframe_refiner.h"
#include "refinement/pose_probability.h"

// The part of KeyframeRefiner that hears a depth camera.

namespace nerf_pose_refiner {

/// Joins depth to what colours said.
void KeyframeRefiner::considerDepth(const TimedObservation& image, Refinement* found) {
  const Observation& observation = image.observation;
  if (!observation.depth) return;
  const FieldMetadata& object = field_->field().metadata;
  const auto keyframe = search_->nearestTo(found->T_O_C);
  const double odds =
      depth_.fuse(*observation.depth, keyframe, object, motionBefore(image.stamp_ns), found);
  constexpr double kSurest = 0.95;  // that no image of the object alone, on a poster say, misleads
  if (odds < 1) {
    found->found_probability = withOdds(std::min(kSurest, *found->found_probability), odds);
  }
  found->hypotheses.front().T_O_C = found->T_O_C;
}

/// The observation without what depth shows before the object. Nothing: there is no such thing.
std::optional<Observation> KeyframeRefiner::withoutOccluders(const Observation& observation,
                                                             const Prior& near) {
  constexpr double kReach = 0.5;  // of the prior: what lies so near before the object may be itself
  const FieldMetadata& object = field_->field().metadata;
  const auto keyframe = search_->nearestTo(near.T_O_C);
  if (!observation.depth || keyframe == nullptr || !(object.metres_per_unit > 0)) return {};
  const double slack = kReach * near.translation * object.diameter * object.metres_per_unit;
  auto weight =
      weightWithoutOccluders(observation, *keyframe, near.T_O_C, {object.metres_per_unit, slack});
  if (!weight) return std::nullopt;
  Observation uncovered = observation;
  uncovered.weight = std::move(*weight);
  return uncovered;
}

/// Aligns once more from where depth alone puts the object, if depth has agreed with colours so far
/// and contradicts them now: a plain object may look right in several places.
void KeyframeRefiner::startFromDepth(const TimedObservation& image, const Expectation& expected,
                                     const CancellationToken& cancellation, Refinement* found) {
  const Observation& observation = image.observation;
  constexpr double kNearlyAsGood = 0.8;  // of the score
  if (found->depth.use != DepthUse::kRefused || !depth_.isEstablished()) return;
  const std::optional<Pose> by_depth =
      depth_.alone(*observation.depth, search_->nearestTo(expected.prior.T_O_C),
                   field_->field().metadata, expected.prior);
  if (!by_depth) return;
  Prior from = expected.prior;
  from.T_O_C = *by_depth;
  Refinement again = refine(
      image, expected, [&] { return search_->near(observation, from, cancellation); },
      cancellation);
  again.seconds += found->seconds;
  if (again.outcome == Outcome::kRefined && again.depth.use == DepthUse::kUsed &&
      again.hypotheses.front().score >= kNearlyAsGood * found->hypotheses.front().score) {
    *found = again;
  }
}

/// Aligns once more without what hides the object, if the first pose shows that something does.
void KeyframeRefiner::lookPastOccluders(const TimedObservation& image, const Expectation& expected,
                                        const CancellationToken& cancellation, Refinement* found) {
  constexpr double kHidden = 0.05, kSlack = 0.04;  // of the surface; [diameters]
  if (found->depth.use != DepthUse::kUsed || found->depth.nearer < kHidden) return;
  Prior near = expected.prior;
  near.T_O_C = found->T_O_C;
  near.translation = std::min(near.translation, kSlack);
  const std::optional<Observation> uncovered = withoutOccluders(image.observation, near);
  if (!uncovered) return;
  near.translation = std::min(expected.prior.translation, kSearchTranslation);
  near.rotation_rad = std::min(near.rotation_rad, kSearchRotation_rad);
  Refinement again = refine(
      {*uncovered, image.stamp_ns}, expected,
      [&] { return search_->near(*uncovered, near, cancellation); }, cancellation);
  again.seconds += found->seconds;
  if (again.outcome == Outcome::kRefined && again.score >= found->score) *found = again;
}

}  // namespace nerf_pose_refiner
