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

namespace nerf_pose_refiner {
namespace {

// A pose that goes on as it did.
Pose extrapolated(const Pose& before, const Pose& now, double ratio) {
  const Eigen::Matrix3d turn = now.R * before.R.transpose();
  return {nearestRotation(expSO3(Eigen::Vector3d(ratio * logSO3(turn))) * now.R),
          now.t + ratio * (now.t - before.t)};
}

/// Makes the hypothesis of a pose the first one.
void bringForward(const Pose& T_O_C, HypothesisTable* hypotheses) {
  const auto one = std::find_if(hypotheses->begin(), hypotheses->end(), [&](const Hypothesis& h) {
    return h.T_O_C.R == T_O_C.R && h.T_O_C.t == T_O_C.t;
  });
  if (one != hypotheses->end()) std::rotate(hypotheses->begin(), one, std::next(one));
}

/// The odds of a pose by its distance from the nearest of the poses that it may have come from.
double oddsOfStart(const Pose& T_O_C, const std::vector<Pose>& rough_T_O_C,
                   const FieldMetadata& object) {
  double best = 0;
  for (const Pose& rough : rough_T_O_C) {
    Prior near;
    near.T_O_C = rough;
    best = std::max(best, priorOdds(T_O_C, near, object));
  }
  return best;
}

}  // namespace

bool KeyframeSearchSettings::wantsKeyframe(const std::optional<ViewDistance>& away) const {
  return !away || away->rotation_rad > renew_rotation_deg * kDegree || away->scale > renew_distance;
}

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
  require(starts_further >= 1, "KeyframeSearchSettings::starts_further", starts_further);
  require(starts_again >= 1, "KeyframeSearchSettings::starts_again", starts_again);
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
  side_views_.emplace(backend_, field_, settings_);
  renderer_.emplace(field_, settings_.keyframe,
                    [search = &*search_](const auto& keyframe) { search->expect(keyframe); });
  use(scores_);
  use(look_alikes_);
}

void KeyframeRefiner::use(const KeyframeScores& scores) {
  scores_ = scores;
  search_->setDoubtful(std::max(settings_.doubtful_score, doubtfulScore(scores_)));
}

void KeyframeRefiner::adaptTo(const Observation& observation) {
  const std::optional<bool> grey = isGrey(observation);
  if (!grey || *grey == settings_.keyframe.grey) return;
  settings_.keyframe.grey = settings_.bank.keyframe.grey = *grey;
  begin();
}

/// Depth alone comes from another camera than colours: where that saw the object last, and for
/// certain, says nothing of this one's images.
void KeyframeRefiner::noteKind(const Observation& observation) {
  if (observation.isDepthAlone() == by_depth_) return;
  by_depth_ = observation.isDepthAlone();
  last_.reset();
  last_motion_.setZero();
  sure_.reset();
}

Refinement KeyframeRefiner::follow(const TimedObservation& image, const Prior& prior,
                                   const CancellationToken& cancellation) {
  noteKind(image.observation);
  const Expectation near = {prior, track_odds_, false};
  if (image.observation.isDepthAlone()) return followByDepth(image, near, cancellation);
  const Camera& camera = image.observation.camera;
  adaptTo(image.observation);
  is_turned_ = false;
  Refinement result = refine(
      image, near,
      [&]() -> HypothesisTable {
        if (!objectRegion(camera, prior, field_->field().metadata)) return {};
        takeRenewal(image.stamp_ns, cancellation);
        if (!search_->distanceOfNearest(prior.T_O_C)) makeAt(camera, {prior.T_O_C}, cancellation);
        std::optional<Observation> uncovered;
        if (depth_.isEstablished()) uncovered = withoutOccluders(image.observation, prior);
        return followed({uncovered ? *uncovered : image.observation, image.stamp_ns}, prior,
                        cancellation);
      },
      cancellation);
  result.is_turned = is_turned_;
  startFromDepth(image, near, cancellation, &result);
  holdTrack(result);
  if (result.outcome == Outcome::kRefined) renewFor({camera, result.T_O_C}, image.stamp_ns);
  return result;
}

/// Any of some rough poses may be right, however far it is from this one.
KeyframeRefiner::Expectation KeyframeRefiner::expectedAnywhere(const Pose& T_O_C) {
  Expectation anywhere;
  anywhere.prior.T_O_C = T_O_C;
  anywhere.prior.rotation_rad = M_PI;
  anywhere.prior.translation = 1;
  anywhere.is_settled = true;
  return anywhere;
}

Refinement KeyframeRefiner::settle(const TimedObservation& image,
                                   const std::vector<Pose>& rough_T_O_C, const PoseOdds& odds,
                                   const CancellationToken& cancellation,
                                   double least_probability) {
  // What depth sees through where nothing was known of the place: a part of its measured surface.
  // (Depth that is refused has no say: it may be broken.)
  constexpr double kSeenThrough = 0.1, kOddsThere = 0.3;
  depth_ = DepthFusion();  // what it has learnt came from other candidates, most of them wrong
  const Camera& camera = image.observation.camera;
  adaptTo(image.observation);
  Expectation anywhere = expectedAnywhere(rough_T_O_C.at(0));
  bool is_given_up = false;
  Refinement result = refine(
      image, anywhere,
      [&]() -> HypothesisTable {
        if (!objectRegion(camera, anywhere.prior, field_->field().metadata)) return {};
        waitForRenderings(cancellation);
        HypothesisTable starts;
        for (const Pose& rough : rough_T_O_C) {
          starts.emplace_back();
          starts.back().T_O_C = rough;
        }
        makeAt(camera, rough_T_O_C, cancellation);
        HypothesisTable found = search_->from(image.observation, starts, cancellation);
        if (!isLive(found)) return found;
        if (odds) bringForward(weighed(found, odds).front().T_O_C, &found);
        const double by_image = scoreProbability(found.front().score, scores_);
        const double of_pose = odds ? odds(found.front().T_O_C) : 1;
        is_given_up = withOdds(by_image, of_pose) < least_probability;
        if (is_given_up) return {};
        // A keyframe from beside drags the pose along: one of the place itself decides.
        makeAt(camera, {found.front().T_O_C}, cancellation);
        found = withoutMistake(image.observation,
                               search_->withBeside(image.observation, found, cancellation),
                               anywhere.prior, cancellation);
        return odds ? weighed(found, odds) : found;
      },
      cancellation);
  if (is_given_up) result.outcome = Outcome::kDiverged;
  if (result.outcome != Outcome::kRefined) return result;
  anywhere.prior.T_O_C = result.T_O_C;
  lookPastOccluders(image, anywhere, cancellation, &result);
  remember(image.stamp_ns, result.T_O_C);
  if (result.depth.use == DepthUse::kUsed && result.depth.farther > kSeenThrough) {
    changeOdds(kOddsThere, &result);
  }
  const double of_start = oddsOfStart(result.T_O_C, rough_T_O_C, field_->field().metadata);
  changeOdds(of_start * (odds ? odds(result.T_O_C) : 1), &result);
  holdTrack(result);
  return result;
}

/// Time since the object was found last; nothing: it was not, or too long ago.
std::optional<double> KeyframeRefiner::sinceLast_s(std::int64_t stamp_ns) const {
  constexpr double kLongest_s = 0.5;
  if (!last_ || stamp_ns <= last_->first) return std::nullopt;
  const double since_s = 1e-9 * static_cast<double>(stamp_ns - last_->first);
  if (since_s > kLongest_s) return std::nullopt;
  return since_s;
}

/// How the object moves from where it was found last to a pose, as the camera's twist a second;
/// zero: it is not known.
Vector6 KeyframeRefiner::motionTo(std::int64_t stamp_ns, const Pose& T_O_C) const {
  const std::optional<double> since_s = sinceLast_s(stamp_ns);
  if (!since_s) return Vector6::Zero();
  return cameraTwist(last_->second, T_O_C, field_->field().metadata.centre) / *since_s;
}

/// How the object moved before an image, which has no part in that: what colours and depth say of
/// it is no motion.
Vector6 KeyframeRefiner::motionBefore(std::int64_t stamp_ns) const {
  return sinceLast_s(stamp_ns) ? last_motion_ : Vector6::Zero();
}

void KeyframeRefiner::remember(std::int64_t stamp_ns, const Pose& T_O_C) {
  last_motion_ = motionTo(stamp_ns, T_O_C);
  last_ = {stamp_ns, T_O_C};
}

Refinement KeyframeRefiner::refine(const TimedObservation& image, const Expectation& expected,
                                   const std::function<HypothesisTable()>& search,
                                   const CancellationToken& cancellation) {
  const Observation& observation = image.observation;
  const Prior& prior = expected.prior;
  const auto begin = std::chrono::steady_clock::now();
  prior.validate();
  Refinement result;
  result.T_O_C = prior.T_O_C;
  SideViews::Own own = {prior, scores_, &*search_, motionTo(image.stamp_ns, prior.T_O_C)};
  std::unique_ptr<SideViews::Ahead> ahead;
  const bool is_tracked = !expected.is_settled && !expected.is_search;
  try {
    if (is_tracked && !observation.side_views.empty()) {
      ahead = side_views_->lookAhead(observation, own, cancellation);
      own.ahead = ahead.get();
    }
    result = conclude(search(), prior);
    if (result.outcome == Outcome::kRefined) judge(image, expected, cancellation, &result);
    // Where nothing is known of the place, other cameras do not look for what this one does not
    // see.
    const bool has_place = !expected.is_settled || result.outcome == Outcome::kRefined;
    if (!observation.side_views.empty() && has_place) {
      own.motion_per_s = motionTo(image.stamp_ns, prior.T_O_C);  // the search may have voided it
      side_views_->join(observation, own, cancellation, &result);
    }
    if (result.outcome == Outcome::kRefined) {
      considerDepth(image, &result);
      rate(&result);
    }
    const FieldMetadata& object = field_->field().metadata;
    if (result.outcome == Outcome::kNoOverlap && objectRegion(observation.camera, prior, object) &&
        !fitsKeyframe({observation.camera, prior.T_O_C}, object)) {
      result.outcome = Outcome::kBadSize;
    }
  } catch (const Cancelled&) {
    result.outcome = Outcome::kCancelled;
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  last_image_ = {image.stamp_ns, result.seconds};
  return result;
}

void KeyframeRefiner::waitForRenderings(const CancellationToken& cancellation) {
  renderer_->pauseAside();
  if (renderer_->busy()) search_->add(renderer_->wait(cancellation));
  side_views_->waitForRenderings(cancellation);
}

void KeyframeRefiner::takeRenewal(std::int64_t stamp_ns, const CancellationToken& cancellation) {
  if (!renderer_->busy()) return;
  const bool began_anew = last_ && stamp_ns <= last_->first;
  if (stamp_ns < due_ns_ && !began_anew) return;
  const auto keyframe = settings_.real_time ? renderer_->take() : renderer_->wait(cancellation);
  if (keyframe) search_->add(keyframe);
}

/// Makes keyframes at those poses that are far from each that exists, and from those before them,
/// where one is possible.
void KeyframeRefiner::makeAt(const Camera& camera, const std::vector<Pose>& poses_T_O_C,
                             const CancellationToken& cancellation) {
  waitForRenderings(cancellation);
  const Eigen::Vector3d& centre = field_->field().metadata.centre;
  std::vector<View> views;
  for (const Pose& T_O_C : poses_T_O_C) {
    const bool is_new = std::all_of(views.begin(), views.end(), [&](const View& other) {
      return settings_.wantsKeyframe(viewDistance(other.T_O_C, T_O_C, centre));
    });
    const bool is_possible = fitsKeyframe({camera, T_O_C}, field_->field().metadata);
    if (is_new && is_possible && settings_.wantsKeyframe(search_->distanceOfNearest(T_O_C))) {
      views.push_back({camera, T_O_C});
    }
  }
  for (KeyframePoints& made : renderKeyframes(*field_, views, settings_.keyframe, cancellation)) {
    search_->add(std::make_shared<const KeyframePoints>(std::move(made)));
  }
}

/// Asks for a keyframe where the object will be when it is done, if there is none near.
void KeyframeRefiner::renewFor(const View& view, std::int64_t stamp_ns) {
  Pose ahead = view.T_O_C;
  if (last_ && stamp_ns > last_->first) {
    constexpr double kMax = 10;  // the motion of so many images, at most
    const double since_s = 1e-9 * static_cast<double>(stamp_ns - last_->first);
    ahead = extrapolated(last_->second, view.T_O_C, std::min(kMax, settings_.renewal_s / since_s));
  }
  remember(stamp_ns, view.T_O_C);
  const View next = {view.camera, ahead};
  if (renderer_->busy() || !settings_.wantsKeyframe(search_->distanceOfNearest(ahead)) ||
      !fitsKeyframe(next, field_->field().metadata)) {
    return;
  }
  due_ns_ = stamp_ns + static_cast<std::int64_t>(1e9 * settings_.renewal_s);
  renderer_->request(next);
}

Refinement KeyframeRefiner::conclude(const HypothesisTable& found, const Prior& prior) const {
  Refinement result;
  result.T_O_C = prior.T_O_C;
  result.hypotheses = found;
  if (!isLive(found)) {
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
  result.covariance = keyframeCovariance(result.hypotheses, prior, object);
  return result;
}

}  // namespace nerf_pose_refiner
