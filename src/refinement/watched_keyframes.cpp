// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/angle.h"
#include "refinement/keyframe_refiner.h"
#include "refinement/look_alike_poses.h"
#include "refinement/pose_probability.h"
#include "refinement/steady_pose.h"

// The part of KeyframeRefiner that doubts what alignment found: whether the object is taken for
// itself, and whether what covers it has dragged its pose away.

namespace nerf_pose_refiner {

void KeyframeRefiner::use(const LookAlikes& look_alikes) {
  if (watch_) watch_->giveTestUp(&*renderer_);
  look_alikes_ = beyondSymmetries(look_alikes, field_->field().metadata.symmetries);
  rolled_.emplace(
      field_->field().metadata, look_alikes_,
      std::make_unique<AsideAlignment>(backend_->makeKeyframeAligner(), settings_.alignment));
  watch_.reset();
  if (look_alikes_.any()) watch_.emplace(field_, look_alikes_);
}

/// @param odds beside the image.
bool KeyframeRefiner::isSure(const HypothesisTable& found, double odds) const {
  if (!isLive(found)) return false;
  return found.front().score >= scoreOfOdds(1 / odds, scores_);
}

/// Hypotheses of a first pose, with a better one first if the object was taken for itself.
HypothesisTable KeyframeRefiner::withoutMistake(const Observation& observation,
                                                const HypothesisTable& found, const Prior& prior,
                                                const CancellationToken& cancellation) {
  constexpr double kWithinReach = 0.5;
  constexpr int kRounds = 3;  // a pose that is far off shows the way, the next one the place
  sure_.reset();
  was_sure_ = true;
  if (!watch_) return found;
  // (What scores little in general may still score far more than wrong poses of this image.)
  const bool may_be_there = isLive(found) && found.front().score > doubtfulScore(scores_);
  if (!may_be_there) {
    watch_->forget();  // what was believed is of another search
    return found;
  }
  HypothesisTable best = found;
  Pose& first = best.front().T_O_C;
  // Alignment may go far along the turn that it holds least: the prior says more of that.
  if (priorOdds(first, prior, field_->field().metadata) < kWithinReach) {
    first = watch_->withTurnOf(prior.T_O_C, first);
  }
  for (int round = 0; round < kRounds; ++round) {
    watch_->begin(observation, best.front().T_O_C, prior, cancellation);
    const std::optional<Pose> motion = watch_->better();
    const Pose before = best.front().T_O_C;
    // (What lies far beyond the prior is said by the belief, but not gone to.)
    if (!motion || priorOdds(*motion * before, prior, field_->field().metadata) < kWithinReach) {
      break;
    }
    best = corrected(observation, best, *motion, cancellation);
    if (best.front().T_O_C.R == before.R) break;
  }
  return best;
}

/// Hypotheses with one that is aligned from where the best one was taken for, if the image shows
/// the object there.
HypothesisTable KeyframeRefiner::corrected(const Observation& observation,
                                           const HypothesisTable& found, const Pose& motion,
                                           const CancellationToken& cancellation) {
  const Pose& mistaken = found.front().T_O_C;
  const auto confirmed = watch_->confirmed(observation, mistaken, motion, cancellation);
  if (!confirmed) return found;
  HypothesisTable start(1);
  start.front().T_O_C = *confirmed * mistaken;
  makeAt(observation.camera, {start.front().T_O_C}, cancellation);
  HypothesisTable better = search_->from(observation, start, cancellation);
  if (!isLive(better)) return found;
  better.front().T_O_C = watch_->withTurnOf(start.front().T_O_C, better.front().T_O_C);
  watch_->moveBy(*confirmed);
  return better;
}

/// A keyframe that shows nearly all that the object shows from a pose and from a few degrees beside
/// it; null: there is none.
std::shared_ptr<const KeyframePoints> KeyframeRefiner::keyframeBeside(const Pose& T_O_C) {
  constexpr double kMax_rad = 15 * kDegree, kMaxScale = 0.25;
  const auto nearest = search_->nearestTo(T_O_C);
  if (nearest == nullptr) return nullptr;
  const ViewDistance away = viewDistance(*nearest, T_O_C);
  return away.rotation_rad <= kMax_rad && away.scale <= kMaxScale ? nearest : nullptr;
}

/// Whether images come so slowly that there is time for a rendering between them. Not if this one
/// was taken before the last one was done with: then it is we who are slow. Nor with further
/// cameras, whose renderings would be waited for, too.
bool KeyframeRefiner::isUnhurried(const TimedObservation& image) const {
  if (!last_image_ || !image.observation.side_views.empty()) return false;
  const double since_s = 1e-9 * static_cast<double>(image.stamp_ns - last_image_->stamp_ns);
  if (since_s < settings_.renewal_s) return false;
  return !settings_.real_time || last_image_->seconds < since_s;
}

/// Hypotheses that are aligned again, from around the best one too, where its keyframe is far
/// beside it or it does not score well. Renders a keyframe of the pose's own place, and waits for
/// it: one from far beside drags the pose along.
HypothesisTable KeyframeRefiner::alignedInOwnPlace(const Observation& observation,
                                                   const HypothesisTable& found,
                                                   const CancellationToken& cancellation) {
  if (!isLive(found) || !mayBeRight(found.front())) return found;
  const Pose& T_O_C = found.front().T_O_C;
  HypothesisTable best = found;
  if (settings_.wantsKeyframe(search_->distanceOfNearest(T_O_C))) {
    makeAt(observation.camera, {T_O_C}, cancellation);
    const HypothesisTable again = search_->from(observation, found, cancellation);
    if (isLive(again)) best = again;
  } else if (isClear(found)) {
    return found;
  }
  return search_->withBeside(observation, best, cancellation);
}

/// Hypotheses near a prior, and near the last pose that was sure if the prior is not.
HypothesisTable KeyframeRefiner::followed(const TimedObservation& image, const Prior& prior,
                                          const CancellationToken& cancellation) {
  constexpr double kAsGood = 0.9;
  HypothesisTable found = search_->near(image.observation, prior, cancellation);
  if (found.empty()) return found;
  if (isUnhurried(image)) found = alignedInOwnPlace(image.observation, found, cancellation);
  if (!was_sure_ && sure_ && search_->distanceOfNearest(*sure_)) {
    HypothesisTable start(1);
    start.front().T_O_C = *sure_;
    const HypothesisTable again = search_->from(image.observation, start, cancellation);
    const bool lives = isLive(again);
    // The object shows rather where it was than where it was looked for meanwhile.
    if (lives && again.front().score > kAsGood * found.front().score) {
      found.insert(found.begin(), again.front());
    }
  }
  was_sure_ = isSure(found, track_odds_);
  const auto nearest = keyframeBeside(found.front().T_O_C);
  if (was_sure_ && nearest != nullptr) {
    found.front().T_O_C = steadyPose(field_->field().metadata, image.observation, prior.T_O_C,
                                     found.front(), *nearest);
  }
  if (watch_ && isLive(found)) {
    found = watched(image, found, prior, cancellation);
  }
  if (isSure(found, 1)) sure_ = found.front().T_O_C;
  return found;
}

/// The hypotheses of a tracked image, turned to where the object is what it may be taken for.
HypothesisTable KeyframeRefiner::watched(const TimedObservation& image, HypothesisTable found,
                                         const Prior& prior,
                                         const CancellationToken& cancellation) {
  watch_->takeTest(image.stamp_ns, !settings_.real_time, &*renderer_, cancellation);
  const auto nearest = keyframeBeside(found.front().T_O_C);
  if (was_sure_ && nearest != nullptr) {
    Pose& pose = found.front().T_O_C;
    pose = watch_->steadied(image.observation, prior.T_O_C, pose, *nearest);
  }
  if (const std::optional<Pose> motion = was_sure_ ? watch_->better() : watch_->guess()) {
    const Pose mistaken = found.front().T_O_C;
    const HypothesisTable other = corrected(image.observation, found, *motion, cancellation);
    if (isSure(other, track_odds_)) found = other;
    was_sure_ = isSure(found, track_odds_);
    is_turned_ = found.front().T_O_C.R != mistaken.R;
    if (is_turned_) last_.reset();  // no motion leads from there to here
  }
  watch_->goOn(image.stamp_ns, found.front().T_O_C, was_sure_);
  watch_->maybeTest(image, found.front().T_O_C, was_sure_, &*renderer_);
  return found;
}

}  // namespace nerf_pose_refiner
