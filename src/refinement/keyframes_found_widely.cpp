// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstddef>
#include <utility>
#include <vector>

#include "refinement/keyframe_refiner.h"
#include "refinement/plan.h"
#include "refinement/pose_probability.h"

// The part of KeyframeRefiner that looks everywhere in a wide prior.

namespace nerf_pose_refiner {

Refinement KeyframeRefiner::find(const TimedObservation& image, const Prior& prior,
                                 const CancellationToken& cancellation,
                                 const std::vector<Pose>& candidates_T_O_C) {
  return find(image, prior, WideSearch{candidates_T_O_C, {settings_.starts}, false}, cancellation);
}

Refinement KeyframeRefiner::findAgain(const TimedObservation& image, const Prior& prior,
                                      const CancellationToken& cancellation) {
  constexpr int kRounds = 8;
  again_ = (again_ + 1) % kRounds;
  const WideSearch glance = {{}, {settings_.starts_again, again_}, /*is_glance=*/true};
  return find(image, prior, glance, cancellation);
}

Refinement KeyframeRefiner::find(const TimedObservation& image, const Prior& prior,
                                 const WideSearch& how, const CancellationToken& cancellation) {
  noteKind(image.observation);
  const Expectation hint = {prior, kHintOdds};
  if (image.observation.isDepthAlone()) return findByDepth(image, hint, cancellation);
  adaptTo(image.observation);
  Refinement result = refine(
      image, hint, [&] { return foundWidely(image.observation, prior, how, cancellation); },
      cancellation);
  lookPastOccluders(image, hint, cancellation, &result);
  holdTrack(result);
  if (result.outcome == Outcome::kRefined) remember(image.stamp_ns, result.T_O_C);
  return result;
}

HypothesisTable KeyframeRefiner::foundWidely(const Observation& observation, const Prior& prior,
                                             const WideSearch& how,
                                             const CancellationToken& cancellation) {
  if (!objectRegion(observation.camera, prior, field_->field().metadata)) return {};
  waitForRenderings(cancellation);
  HypothesisTable found = foundFrom(observation, prior, how, cancellation);
  if (!how.is_glance && !isClear(found)) {
    found = foundFurther(observation, prior, how, found, cancellation);
  }
  return withoutMistake(observation, found, prior, cancellation);
}

/// Where coarse alignments from around the prior lead. In a glance, keyframes are rendered only
/// where there is hope.
HypothesisTable KeyframeRefiner::foundFrom(const Observation& observation, const Prior& prior,
                                           const WideSearch& how,
                                           const CancellationToken& cancellation) {
  constexpr std::size_t kRendered = 2;  // of the candidates
  HypothesisTable starts = search_->around(observation, prior, how.starts, cancellation);
  std::vector<Pose> rendered;
  if (!starts.empty()) rendered.push_back(starts.front().T_O_C);
  const auto add = [&](const Pose& T_O_C) {
    starts.emplace_back();
    starts.back().T_O_C = T_O_C;
  };
  const std::size_t candidates = std::min(kRendered, how.candidates_T_O_C.size());
  for (std::size_t i = 0; i < candidates; ++i) {
    add(how.candidates_T_O_C[i]);
    rendered.push_back(how.candidates_T_O_C[i]);
  }
  // The prior, too: it may be nearly right, and small views of it may show too little.
  add(prior.T_O_C);
  HypothesisTable found;
  if (how.is_glance) found = search_->from(observation, starts, cancellation);
  // (Where no keyframe reaches, its small view says whether one is worth while.)
  const Hypothesis& first = starts.front();
  const bool has_hope = found.empty() || mayBeRight(found.front()) ||
                        (!search_->distanceOfNearest(first.T_O_C) && mayBeRight(first));
  if (!has_hope) return found;
  // The prior has a keyframe of its own only if it may be needed, for that takes longer than all
  // the rest.
  for (const std::vector<Pose>& poses_T_O_C : {rendered, std::vector<Pose>{prior.T_O_C}}) {
    makeAt(observation.camera, poses_T_O_C, cancellation);
    found = search_->from(observation, starts, cancellation);
    if (isClear(found)) return found;
  }
  return search_->withBeside(observation, found, cancellation);
}

/// Tries more starts where what was found is not clear, and lets keyframes decide that are rendered
/// where alignment leads: one from beside drags the pose along.
HypothesisTable KeyframeRefiner::foundFurther(const Observation& observation, const Prior& prior,
                                              const WideSearch& how, const HypothesisTable& before,
                                              const CancellationToken& cancellation) {
  constexpr int kRefined = 128, kFinalists = 16;  // of the starts
  constexpr int kRounds = 2;                      // of keyframes where alignment leads
  WideSearch further = how;
  further.starts = {settings_.starts_further, /*round=*/1, kRefined, kFinalists};
  HypothesisTable found = foundFrom(observation, prior, further, cancellation);
  const bool was_better =
      isLive(before) && (!isLive(found) || before.front().score > found.front().score);
  if (was_better) found = before;
  for (int round = 0; round < kRounds && isLive(found) && !isClear(found); ++round) {
    const Pose best = found.front().T_O_C;
    if (!settings_.wantsKeyframe(search_->distanceOfNearest(best))) break;
    makeAt(observation.camera, {best}, cancellation);
    found = search_->withBeside(observation, found, cancellation);
  }
  return found;
}

}  // namespace nerf_pose_refiner
