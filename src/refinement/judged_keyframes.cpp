// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "refinement/covariance.h"
#include "refinement/keyframe_refiner.h"
#include "refinement/pose_probability.h"

// The part of KeyframeRefiner that says how likely what alignment found is right.

namespace nerf_pose_refiner {

/// Hypotheses with what is better beside the best one, unless that is clear. (A turn that images
/// hardly hold is the watch's to find.)
HypothesisTable KeyframeRefiner::lookedBeside(const HypothesisTable& found,
                                              const Expectation& expected,
                                              const CancellationToken& cancellation) {
  if (!expected.is_anew || found.empty() || look_alikes_.axis || isClear(found.front())) {
    return found;
  }
  return search_->withBeside(found, cancellation);
}

/// Whether a hypothesis scores so well that nothing else has to be tried.
bool KeyframeRefiner::isClear(const Hypothesis& found) const {
  constexpr double kClear = 0.97;
  return scoreProbability(found.score, scores_) > kClear;
}

/// Says how likely the best hypothesis is right, and how far off it may be.
void KeyframeRefiner::judge(const Expectation& expected, const CancellationToken& cancellation,
                            Refinement* found) {
  const FieldMetadata& object = field_->field().metadata;
  const Hypothesis& best = found->hypotheses.front();
  found->covariance += systematicCovariance(found->covariance, found->T_O_C, object);
  if (const auto other = search_->secondOpinion(best, cancellation)) {
    found->covariance +=
        disagreement(cameraTwist(best.T_O_C, other->T_O_C, object.centre), other->beside_rad);
  }
  found->wrong_score = wrongScore(best, expected, cancellation);
  const double by_image = probabilityByImage(*found);
  const double odds = priorOdds(found->T_O_C, expected.prior, object);
  const bool is_there = distanceFromPrior(found->T_O_C, expected.prior, object) <= kWithinPrior;
  found->found_probability = withOdds(by_image, is_there ? expected.odds : odds);
}

/// Images of a track that are clear need no comparison with wrong poses. In others, one is tried an
/// image: those of the images before say the rest.
std::optional<double> KeyframeRefiner::wrongScore(const Hypothesis& best,
                                                  const Expectation& expected,
                                                  const CancellationToken& cancellation) {
  if (expected.is_anew) {
    rolled_->tryAll(best, &*search_, cancellation);
  } else if (isClear(best)) {
    return std::nullopt;
  } else {
    rolled_->tryNext(best, &*search_, cancellation);
  }
  return rolled_->best();
}

/// Of a pose that was found.
double KeyframeRefiner::probabilityByImage(const Refinement& found) const {
  return scoreProbability(found.hypotheses.front().score, found.wrong_score, scores_);
}

void KeyframeRefiner::holdTrack(const Refinement& found) {
  holdTrack(found, found.outcome == Outcome::kRefined ? probabilityByImage(found) : 0);
}

/// A pose that is certain by its image alone is worth kTrackOdds in the images after it. Each that
/// is rather wrong by its image alone takes a little of that: images of a sequence are alike, so
/// their scores are no independent evidence.
/// @param probability that the image alone gives what was found.
void KeyframeRefiner::holdTrack(const Refinement& found, double probability) {
  constexpr double kCertain = 0.9, kEven = 0.5, kKept = 0.97;
  const bool is_found = found.outcome == Outcome::kRefined;
  const double told = is_found ? found.unmistaken.value_or(1) : 0;
  if (told * found.found_probability.value_or(0) < kEven) {
    track_odds_ = 1;
    return;
  }
  const double by_image = told * probability;
  if (by_image >= kCertain) track_odds_ = kTrackOdds;
  if (by_image < kEven) track_odds_ = std::max(1.0, kKept * track_odds_);
}

/// Sets the score, once all that sees the object has been heard.
void KeyframeRefiner::rate(Refinement* found) const {
  if (watch_) watch_->judge(found);
  found->score = *found->found_probability *
                 withinProbability(found->covariance, field_->field().metadata) *
                 found->unmistaken.value_or(1);
}

}  // namespace nerf_pose_refiner
