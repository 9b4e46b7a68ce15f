// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/keyframe_refiner.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>

#include "math/angle.h"
#include "math/require.h"
#include "refinement/grey_image.h"
#include "refinement/plan.h"
#include "refinement/pose_probability.h"
#include "refinement/steady_pose.h"

namespace nerf_pose_refiner {
namespace {

// A pose that goes on as it did.
Pose extrapolated(const Pose& before, const Pose& now, double ratio) {
  const Eigen::Matrix3d turn = now.R * before.R.transpose();
  return {nearestRotation(expSO3(Eigen::Vector3d(ratio * logSO3(turn))) * now.R),
          now.t + ratio * (now.t - before.t)};
}

/// The odds of a pose by the most likely one of those that it may have come from.
double oddsOf(const Pose& T_O_C, const std::vector<RoughPose>& rough, const FieldMetadata& object) {
  double best = 0;
  for (const RoughPose& one : rough) {
    Prior near;
    near.T_O_C = one.T_O_C;
    best = std::max(best, one.odds * priorOdds(T_O_C, near, object));
  }
  return best;
}

}  // namespace

void KeyframeSearchSettings::validate() const {
  keyframe.validate();
  bank.validate();
  require(renew_rotation_deg > 0, "KeyframeSearchSettings::renew_rotation_deg", renew_rotation_deg);
  require(renew_distance > 0, "KeyframeSearchSettings::renew_distance", renew_distance);
  require(reach_rotation_deg >= renew_rotation_deg, "KeyframeSearchSettings::reach_rotation_deg",
          reach_rotation_deg);
  require(reach_distance >= renew_distance, "KeyframeSearchSettings::reach_distance",
          reach_distance);
  require(renewal_s >= 0, "KeyframeSearchSettings::renewal_s", renewal_s);
  require(max_keyframes >= 1, "KeyframeSearchSettings::max_keyframes", max_keyframes);
  require(wide_starts >= 0, "KeyframeSearchSettings::wide_starts", wide_starts);
  require(starts >= 1, "KeyframeSearchSettings::starts", starts);
}

KeyframeRefiner::KeyframeRefiner(Backend* backend, std::shared_ptr<const LoadedField> field,
                                 const KeyframeSearchSettings& settings)
    : backend_(backend),
      field_(std::move(field)),
      settings_(settings),
      scores_(field_->field().metadata.pose.keyframes),
      look_alikes_(field_->field().metadata.look_alikes) {
  settings_.validate();
  begin();
}

/// Without keyframes.
void KeyframeRefiner::begin() {
  watch_.reset();
  renderer_.reset();
  search_.emplace(backend_, field_, settings_);
  renderer_.emplace(field_, settings_.keyframe);
  use(look_alikes_);
}

void KeyframeRefiner::use(const LookAlikes& look_alikes) {
  if (watch_) watch_->giveTestUp(&*renderer_);
  look_alikes_ = look_alikes;
  watch_.reset();
  if (look_alikes_.any()) watch_.emplace(field_, look_alikes_);
}

void KeyframeRefiner::adaptTo(const Observation& observation) {
  const std::optional<bool> grey = isGrey(observation);
  if (!grey || *grey == settings_.keyframe.grey) return;
  settings_.keyframe.grey = settings_.bank.keyframe.grey = *grey;
  begin();
}

Refinement KeyframeRefiner::follow(const TimedObservation& image, const Prior& prior,
                                   const CancellationToken& cancellation) {
  const Camera& camera = image.observation.camera;
  adaptTo(image.observation);
  const Refinement result = refine(
      prior,
      [&]() -> HypothesisTable {
        if (!objectRegion(camera, prior, field_->field().metadata)) return {};
        takeRenewal(image.stamp_ns, cancellation);
        if (!search_->distanceOfNearest(prior.T_O_C)) makeAt({camera, prior.T_O_C}, cancellation);
        return followed(image, prior, cancellation);
      },
      cancellation);
  if (result.outcome == Outcome::kRefined) renewFor({camera, result.T_O_C}, image.stamp_ns);
  return result;
}

Refinement KeyframeRefiner::find(const TimedObservation& image, const Prior& prior,
                                 const CancellationToken& cancellation,
                                 const std::vector<Pose>& candidates_T_O_C) {
  constexpr std::size_t kRendered = 2;  // of the poses of either kind
  const Camera& camera = image.observation.camera;
  adaptTo(image.observation);
  const Refinement result = refine(
      prior,
      [&]() -> HypothesisTable {
        if (!objectRegion(camera, prior, field_->field().metadata)) return {};
        waitForRenderings(cancellation);
        HypothesisTable starts = search_->around(image.observation, prior, cancellation);
        for (std::size_t i = 0; i < std::min(kRendered, starts.size()); ++i) {
          if (isFar(starts[i].T_O_C)) makeAt({camera, starts[i].T_O_C}, cancellation);
        }
        for (std::size_t i = 0; i < std::min(kRendered, candidates_T_O_C.size()); ++i) {
          if (isFar(candidates_T_O_C[i])) makeAt({camera, candidates_T_O_C[i]}, cancellation);
          starts.emplace_back();
          starts.back().T_O_C = candidates_T_O_C[i];
        }
        return withoutMistake(image.observation,
                              search_->from(image.observation, starts, cancellation), prior,
                              cancellation);
      },
      cancellation);
  if (result.outcome == Outcome::kRefined) last_ = {image.stamp_ns, result.T_O_C};
  return result;
}

Refinement KeyframeRefiner::settle(const TimedObservation& image,
                                   const std::vector<RoughPose>& rough,
                                   const CancellationToken& cancellation) {
  const Camera& camera = image.observation.camera;
  adaptTo(image.observation);
  // Any of them may be right, however far it is from the first one.
  Prior anywhere;
  anywhere.T_O_C = rough.at(0).T_O_C;
  anywhere.rotation_rad = M_PI;
  anywhere.translation = 1;
  Refinement result = refine(
      anywhere,
      [&]() -> HypothesisTable {
        if (!objectRegion(camera, anywhere, field_->field().metadata)) return {};
        waitForRenderings(cancellation);
        HypothesisTable starts;
        for (const RoughPose& one : rough) {
          if (isFar(one.T_O_C)) makeAt({camera, one.T_O_C}, cancellation);
          starts.emplace_back();
          starts.back().T_O_C = one.T_O_C;
        }
        return withoutMistake(image.observation,
                              search_->from(image.observation, starts, cancellation), anywhere,
                              cancellation);
      },
      cancellation);
  if (result.outcome != Outcome::kRefined) return result;
  last_ = {image.stamp_ns, result.T_O_C};
  const double found = *result.found_probability;
  result.found_probability = withOdds(found, oddsOf(result.T_O_C, rough, field_->field().metadata));
  result.score *= found > 0 ? *result.found_probability / found : 0;
  return result;
}

Refinement KeyframeRefiner::refine(const Prior& prior,
                                   const std::function<HypothesisTable()>& search,
                                   const CancellationToken& cancellation) {
  const auto begin = std::chrono::steady_clock::now();
  prior.validate();
  Refinement result;
  result.T_O_C = prior.T_O_C;
  try {
    result = conclude(search(), prior);
    if (result.outcome == Outcome::kRefined) judge(prior, cancellation, &result);
  } catch (const Cancelled&) {
    result.outcome = Outcome::kCancelled;
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

bool KeyframeRefiner::isSure(const HypothesisTable& found) const {
  return !found.empty() && found.front().state == HypothesisState::kLive &&
         scoreProbability(found.front().score, scores_) >= 0.5;
}

/// Hypotheses of a first pose, with a better one first if the object was taken for itself.
HypothesisTable KeyframeRefiner::withoutMistake(const Observation& observation,
                                                const HypothesisTable& found, const Prior& prior,
                                                const CancellationToken& cancellation) {
  constexpr int kRounds = 3;  // a pose that is far off shows the way, the next one the place
  sure_.reset();
  was_sure_ = true;
  if (!watch_ || !isSure(found)) return found;
  HypothesisTable best = found;
  for (int round = 0; round < kRounds; ++round) {
    watch_->begin(observation, best.front().T_O_C, prior, cancellation);
    const std::optional<Pose> motion = watch_->better();
    if (!motion) break;
    const Pose before = best.front().T_O_C;
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
  if (isFar(start.front().T_O_C)) {
    makeAt({observation.camera, start.front().T_O_C}, cancellation);
  }
  HypothesisTable better = search_->from(observation, start, cancellation);
  if (better.empty() || better.front().state != HypothesisState::kLive) return found;
  better.front().T_O_C = watch_->withTurnOf(start.front().T_O_C, better.front().T_O_C);
  watch_->moveBy(*confirmed);
  return better;
}

/// Hypotheses near a prior, and near the last pose that was sure if the prior is not.
HypothesisTable KeyframeRefiner::followed(const TimedObservation& image, const Prior& prior,
                                          const CancellationToken& cancellation) {
  constexpr double kAsGood = 0.9;
  HypothesisTable found = search_->near(image.observation, prior, cancellation);
  if (found.empty()) return found;
  if (!was_sure_ && sure_ && search_->distanceOfNearest(*sure_)) {
    HypothesisTable start(1);
    start.front().T_O_C = *sure_;
    const HypothesisTable again = search_->from(image.observation, start, cancellation);
    const bool lives = !again.empty() && again.front().state == HypothesisState::kLive;
    // The object shows rather where it was than where it was looked for meanwhile.
    if (lives && again.front().score > kAsGood * found.front().score) {
      found.insert(found.begin(), again.front());
    }
  }
  was_sure_ = isSure(found);
  if (was_sure_) {
    found.front().T_O_C =
        steadyPose(*field_, image.observation, prior.T_O_C, found.front(), cancellation);
  }
  if (watch_ && found.front().state == HypothesisState::kLive) {
    found = watched(image, found, prior, cancellation);
  }
  if (was_sure_) sure_ = found.front().T_O_C;
  return found;
}

/// The hypotheses of a tracked image, turned to where the object is what it may be taken for.
HypothesisTable KeyframeRefiner::watched(const TimedObservation& image, HypothesisTable found,
                                         const Prior& prior,
                                         const CancellationToken& cancellation) {
  watch_->takeTest(image.stamp_ns, !settings_.real_time, &*renderer_, cancellation);
  if (was_sure_) {
    Pose& pose = found.front().T_O_C;
    pose = watch_->steadied(image.observation, prior.T_O_C, pose, cancellation);
  }
  if (const std::optional<Pose> motion = was_sure_ ? watch_->better() : watch_->guess()) {
    const HypothesisTable other = corrected(image.observation, found, *motion, cancellation);
    if (isSure(other)) found = other;
    was_sure_ = isSure(found);
  }
  watch_->goOn(image.stamp_ns, found.front().T_O_C, was_sure_);
  watch_->maybeTest(image, found.front().T_O_C, was_sure_, &*renderer_);
  return found;
}

void KeyframeRefiner::waitForRenderings(const CancellationToken& cancellation) {
  if (watch_) watch_->giveTestUp(&*renderer_);
  if (renderer_->busy()) search_->add(renderer_->wait(cancellation));
}

void KeyframeRefiner::takeRenewal(std::int64_t stamp_ns, const CancellationToken& cancellation) {
  if (!renderer_->busy()) return;
  const bool began_anew = last_ && stamp_ns <= last_->first;
  if (stamp_ns < due_ns_ && !began_anew) return;
  const auto keyframe = settings_.real_time ? renderer_->take() : renderer_->wait(cancellation);
  if (keyframe) search_->add(keyframe);
}

void KeyframeRefiner::makeAt(const View& view, const CancellationToken& cancellation) {
  waitForRenderings(cancellation);
  renderer_->request(view);
  search_->add(renderer_->wait(cancellation));
}

/// Whether a pose wants a keyframe of its own.
bool KeyframeRefiner::isFar(const Pose& T_O_C) {
  const std::optional<ViewDistance> away = search_->distanceOfNearest(T_O_C);
  return !away || away->rotation_rad > settings_.renew_rotation_deg * kDegree ||
         away->scale > settings_.renew_distance;
}

/// Asks for a keyframe where the object will be when it is done, if there is none near.
void KeyframeRefiner::renewFor(const View& view, std::int64_t stamp_ns) {
  Pose ahead = view.T_O_C;
  if (last_ && stamp_ns > last_->first) {
    constexpr double kMost = 10;  // the motion of so many images, at most
    const double since_s = 1e-9 * static_cast<double>(stamp_ns - last_->first);
    ahead = extrapolated(last_->second, view.T_O_C, std::min(kMost, settings_.renewal_s / since_s));
  }
  last_ = {stamp_ns, view.T_O_C};
  if (renderer_->busy() || !isFar(ahead)) return;
  due_ns_ = stamp_ns + static_cast<std::int64_t>(1e9 * settings_.renewal_s);
  renderer_->request({view.camera, ahead});
}

/// Says how likely the best hypothesis is right, and how far off it may be.
void KeyframeRefiner::judge(const Prior& prior, const CancellationToken& cancellation,
                            Refinement* found) {
  const FieldMetadata& object = field_->field().metadata;
  const Hypothesis& best = found->hypotheses.front();
  found->covariance += systematicCovariance(found->covariance, found->T_O_C, object);
  if (const auto other = search_->secondOpinion(best, cancellation)) {
    found->covariance +=
        disagreement(cameraTwist(best.T_O_C, other->T_O_C, object.centre), other->beside_rad);
  }
  const double by_image = scoreProbability(best.score, scores_);
  const double odds = priorOdds(found->T_O_C, prior, object);
  const double by_both = withOdds(by_image, odds);
  found->found_probability = by_both;
  found->score = by_both * withinProbability(found->covariance, object);
  if (watch_) watch_->judge(found);
}

Refinement KeyframeRefiner::conclude(const HypothesisTable& found, const Prior& prior) const {
  Refinement result;
  result.T_O_C = prior.T_O_C;
  result.hypotheses = found;
  if (found.empty() || found.front().state != HypothesisState::kLive) {
    // (Without a hypothesis the prior lies outside of the image.)
    const bool outside = found.empty() || found.front().state == HypothesisState::kOutOfImage;
    result.outcome = outside ? Outcome::kNoOverlap : Outcome::kDiverged;
    return result;
  }
  const FieldMetadata& object = field_->field().metadata;
  result.hypotheses = nearestEquivalents(found, prior, object);
  const Hypothesis& best = result.hypotheses.front();
  result.outcome = Outcome::kRefined;
  result.T_O_C = {nearestRotation(best.T_O_C.R), best.T_O_C.t};
  result.visible_fraction = best.visible_fraction;
  result.covariance = poseCovariance(result.hypotheses, prior, object);
  return result;
}

}  // namespace nerf_pose_refiner
