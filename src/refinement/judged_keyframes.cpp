// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <future>
#include <optional>

#include "refinement/colour_comparison.h"
#include "refinement/covariance.h"
#include "refinement/keyframe_refiner.h"
#include "refinement/look_alike_poses.h"
#include "refinement/pose_probability.h"

// The part of KeyframeRefiner that says how likely what alignment found is right.

namespace nerf_pose_refiner {

/// Whether a hypothesis scores so well that nothing else has to be tried.
bool KeyframeRefiner::isClear(const Hypothesis& found) const {
  constexpr double kClear = 0.97;
  return found.state == HypothesisState::kLive && scoreProbability(found.score, scores_) > kClear;
}

/// Whether an image alone gives a hypothesis more than a hopeless probability.
bool KeyframeRefiner::mayBeRight(const Hypothesis& found) const {
  return found.state == HypothesisState::kLive &&
         scoreProbability(found.score, scores_) > kHopelessProbability;
}

/// Says how likely the best hypothesis is right, and how far off it may be.
void KeyframeRefiner::judge(const TimedObservation& image, const Expectation& expected,
                            const CancellationToken& cancellation, Refinement* found) {
  const FieldMetadata& object = field_->field().metadata;
  const Hypothesis& best = found->hypotheses.front();
  if (const auto other = search_->secondOpinion(best, cancellation)) {
    // (Elsewhere the keyframe that found the pose need not be the nearest one.)
    const double own_rad = expected.is_settled ? other->own_beside_rad : other->beside_rad;
    found->covariance += disagreement(cameraTwist(best.T_O_C, other->T_O_C, object.centre),
                                      other->beside_rad, own_rad);
  }
  std::future<std::optional<double>> colours;  // compared beside alignment
  if (const auto nearest = search_->nearestTo(best.T_O_C);
      nearest != nullptr && expected.is_search) {
    colours = std::async([nearest, &image, &best] {
      return chromaticDifference(*nearest, image.observation, best.T_O_C);
    });
  }
  found->rolled_score = rolledScore(image, best, expected, cancellation);
  if (colours.valid()) found->chromatic_difference = colours.get();
  const double by_image = probabilityByImage(*found);
  const double of_colours = oddsOfColours(found->chromatic_difference);
  Prior prior = expected.prior;
  if (!expected.is_search) {  // a track that took the object for itself says nothing against that
    prior.T_O_C = nearestLookAlike(prior.T_O_C, found->T_O_C, look_alikes_);
  }
  const double odds = priorOdds(found->T_O_C, prior, object);
  const bool is_there = distanceFromPrior(found->T_O_C, prior, object) <= kWithinPrior;
  found->found_probability = withOdds(by_image, of_colours * (is_there ? expected.odds : odds));
}

/// What wrong poses score in an image; nothing: it is not known. A track needs it most in images
/// that are not clear; in those that are, it is kept up to date, beside tracking.
std::optional<double> KeyframeRefiner::rolledScore(const TimedObservation& image,
                                                   const Hypothesis& best,
                                                   const Expectation& expected,
                                                   const CancellationToken& cancellation) {
  constexpr std::int64_t kUpToDate_ns = 100000000;
  const std::optional<std::int64_t> last_ns = rolled_->last_ns();
  const bool is_up_to_date =
      last_ns && *last_ns <= image.stamp_ns && image.stamp_ns - *last_ns < kUpToDate_ns;
  if (expected.is_search) {
    rolled_->tryAll(image, best, &*search_, cancellation);
  } else {
    rolled_->takeTried(!settings_.real_time, cancellation);
    if (!is_up_to_date || !isClear(best)) {
      rolled_->tryNext(image, best, search_->nearestTo(best.T_O_C));
    }
  }
  return rolled_->bestBeside(best.T_O_C, image.stamp_ns);
}

/// Of a pose that was found.
double KeyframeRefiner::probabilityByImage(const Refinement& found) const {
  return scoreProbability(found.hypotheses.front().score, found.rolled_score, scores_);
}

void KeyframeRefiner::holdTrack(const Refinement& found) {
  holdTrack(found, found.outcome == Outcome::kRefined ? probabilityByImage(found) : 0);
}

/// A pose that is certain by its image alone is worth kTrackOdds in the images after it. Each that
/// is rather wrong by its image alone takes a little of that: images of a sequence are alike, so
/// their scores are no independent evidence.
/// @param probability that the image alone gives what was found.
void KeyframeRefiner::holdTrack(const Refinement& found, double probability) {
  constexpr double kCertain = 0.9, kEven = 0.5, kKept = 0.93;
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
