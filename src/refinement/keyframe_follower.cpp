// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/keyframe_follower.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <string>
#include <utility>

#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kDegree = 0.017453292519943295;
constexpr std::uint64_t kSeed = 1;
constexpr double kWindowMargin = 0.2, kWideMargin = 0.5;  // around the object [diameters]

void require(bool is_right, const char* name, double value) {
  if (!is_right) {
    throw std::invalid_argument(std::string("KeyframeSearchSettings::") + name + " is " +
                                std::to_string(value));
  }
}

// Angle between the lines of sight to the object's centre, and how far off the distance is.
struct ViewDistance {
  double rotation_rad;
  double distance;  // relative
};

ViewDistance viewDistance(const KeyframePoints& keyframe, const Pose& T_O_C) {
  const Eigen::Vector3d then = keyframe.T_O_C.t - keyframe.centre;
  const Eigen::Vector3d now = T_O_C.t - keyframe.centre;
  return {std::atan2(now.cross(then).norm(), now.dot(then)),
          std::abs(std::log(now.norm() / then.norm()))};
}

bool isBetter(const Hypothesis& a, const Hypothesis& b) {
  const bool a_lives = a.state == HypothesisState::kLive,
             b_lives = b.state == HypothesisState::kLive;
  return a_lives != b_lives ? a_lives : a.loss < b.loss;
}

// A pose that goes on as it did.
Pose extrapolated(const Pose& before, const Pose& now, double ratio) {
  const Eigen::Matrix3d turn = now.R * before.R.transpose();
  return {nearestRotation(expSO3(Eigen::Vector3d(ratio * logSO3(turn))) * now.R),
          now.t + ratio * (now.t - before.t)};
}

// A number in -1..1.
double drawn(std::uint64_t start, int axis) {
  return 2 * randomUniform(kSeed, static_cast<std::uint64_t>(axis), start) - 1;
}

}  // namespace

void KeyframeSearchSettings::validate() const {
  keyframe.validate();
  require(renew_rotation_deg > 0, "renew_rotation_deg", renew_rotation_deg);
  require(renew_distance > 0, "renew_distance", renew_distance);
  require(reach_rotation_deg >= renew_rotation_deg, "reach_rotation_deg", reach_rotation_deg);
  require(reach_distance >= renew_distance, "reach_distance", reach_distance);
  require(renewal_s >= 0, "renewal_s", renewal_s);
  require(max_keyframes >= 1, "max_keyframes", max_keyframes);
  require(wide_starts >= 0, "wide_starts", wide_starts);
}

KeyframeFollower::KeyframeFollower(Backend* backend, std::shared_ptr<const LoadedField> field,
                                   const KeyframeSearchSettings& settings)
    : field_(std::move(field)),
      settings_(settings),
      aligner_(backend->makeKeyframeAligner()),
      renderer_(field_, settings.keyframe) {
  settings_.validate();
}

Refinement KeyframeFollower::follow(const TimedObservation& image, const Prior& prior,
                                    const CancellationToken& cancellation) {
  const Observation& observation = image.observation;
  const std::int64_t stamp_ns = image.stamp_ns;
  const auto begin = std::chrono::steady_clock::now();
  prior.validate();
  ++images_;
  Refinement result;
  result.T_O_C = prior.T_O_C;
  try {
    takeRenewal(stamp_ns, cancellation);
    const View view = {observation.camera, prior.T_O_C};
    if (nearest(prior.T_O_C) == nullptr) makeAt(view, cancellation);
    result = conclude(alignFrom(observation, prior, cancellation), prior);
    if (result.outcome == Outcome::kRefined) {
      renewFor({observation.camera, result.T_O_C}, stamp_ns);
    }
  } catch (const Cancelled&) {
    result.outcome = Outcome::kCancelled;
  }
  result.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  return result;
}

void KeyframeFollower::waitForRenderings(const CancellationToken& cancellation) {
  if (renderer_.busy()) keep(renderer_.wait(cancellation));
}

void KeyframeFollower::takeRenewal(std::int64_t stamp_ns, const CancellationToken& cancellation) {
  // (A stamp from before the request: the images began anew.)
  if (!renderer_.busy() || (stamp_ns < due_ns_ && last_ && stamp_ns > last_->first)) return;
  const auto keyframe = settings_.real_time ? renderer_.take() : renderer_.wait(cancellation);
  if (keyframe) keep(keyframe);
}

void KeyframeFollower::keep(std::shared_ptr<const KeyframePoints> keyframe) {
  if (kept_.size() >= static_cast<std::size_t>(settings_.max_keyframes)) {
    const auto oldest = std::min_element(
        kept_.begin(), kept_.end(), [](const Kept& a, const Kept& b) { return a.used < b.used; });
    aligner_->remove(oldest->number);
    kept_.erase(oldest);
  }
  const int number = aligner_->add(keyframe);
  kept_.push_back({number, std::move(keyframe), images_});
  ++made_;
}

/// The keyframe that shows the object most as a pose does; null: none can be aligned.
KeyframeFollower::Kept* KeyframeFollower::nearest(const Pose& T_O_C) {
  Kept* best = nullptr;
  double least = 1;
  for (Kept& kept : kept_) {
    const ViewDistance away = viewDistance(*kept.keyframe, T_O_C);
    const double cost = std::hypot(away.rotation_rad / (settings_.reach_rotation_deg * kDegree),
                                   away.distance / settings_.reach_distance);
    if (!(cost < least)) continue;
    least = cost;
    best = &kept;
  }
  return best;
}

void KeyframeFollower::makeAt(const View& view, const CancellationToken& cancellation) {
  waitForRenderings(cancellation);
  if (nearest(view.T_O_C) != nullptr) return;
  renderer_.request(view);
  keep(renderer_.wait(cancellation));
}

/// Asks for a keyframe where the object will be when it is done, if there is none near.
void KeyframeFollower::renewFor(const View& view, std::int64_t stamp_ns) {
  Pose ahead = view.T_O_C;
  if (last_ && stamp_ns > last_->first) {
    constexpr double kMost = 10;  // the motion of so many images, at most
    const double since_s = 1e-9 * static_cast<double>(stamp_ns - last_->first);
    ahead = extrapolated(last_->second, view.T_O_C, std::min(kMost, settings_.renewal_s / since_s));
  }
  last_ = {stamp_ns, view.T_O_C};
  if (renderer_.busy()) return;
  const Kept* near = nearest(ahead);
  if (near != nullptr) {
    const ViewDistance away = viewDistance(*near->keyframe, ahead);
    if (away.rotation_rad < settings_.renew_rotation_deg * kDegree &&
        away.distance < settings_.renew_distance) {
      return;
    }
  }
  due_ns_ = stamp_ns + static_cast<std::int64_t>(1e9 * settings_.renewal_s);
  renderer_.request({view.camera, ahead});
}

HypothesisTable KeyframeFollower::alignFrom(const Observation& observation, const Prior& prior,
                                            const CancellationToken& cancellation) {
  Kept* const kept = nearest(prior.T_O_C);
  if (kept == nullptr) return {};
  kept->used = images_;
  const KeyframePoints& keyframe = *kept->keyframe;
  aligner_->observe(observation,
                    frameWindowFor(keyframe, observation.camera, prior.T_O_C, kWindowMargin));
  HypothesisTable found =
      aligner_->align({{kept->number, prior.T_O_C}}, settings_.alignment, cancellation);
  const bool doubtful = found.front().state != HypothesisState::kLive ||
                        found.front().score < settings_.doubtful_score;
  if (!doubtful || settings_.wide_starts == 0) return found;
  aligner_->observe(observation,
                    frameWindowFor(keyframe, observation.camera, prior.T_O_C, kWideMargin));
  for (const Hypothesis& other : searchWidely(prior, cancellation)) found.push_back(other);
  std::stable_sort(found.begin(), found.end(), isBetter);
  return found;
}

/// Coarse alignments from all around the prior; the best go on to the finest level.
HypothesisTable KeyframeFollower::searchWidely(const Prior& prior,
                                               const CancellationToken& cancellation) {
  constexpr double kSpread = 3;  // of the prior's half widths
  constexpr std::size_t kFinalists = 3;
  const FieldMetadata& object = field_->field().metadata;
  std::vector<KeyframeStart> starts;
  for (int i = 0; i < settings_.wide_starts; ++i) {
    Eigen::Vector3d turn, shift;
    for (int a = 0; a < 3; ++a) {
      turn[a] = kSpread * prior.rotation_rad * drawn(i, a);
      shift[a] = kSpread * prior.translation * object.diameter * drawn(i, 3 + a);
    }
    const Eigen::Matrix3d R = expSO3(turn);
    const Pose start = {nearestRotation(R * prior.T_O_C.R),
                        object.centre + shift + R * (prior.T_O_C.t - object.centre)};
    if (const Kept* kept = nearest(start)) starts.push_back({kept->number, start});
  }
  KeyframeAlignmentSettings coarse = settings_.alignment;
  coarse.finest_level = std::min(2, settings_.keyframe.levels - 1);
  coarse.observed_fraction = coarse.coarse_observed_fraction;
  coarse.convergence_px = coarse.coarse_convergence_px;
  const HypothesisTable rough = aligner_->align(starts, coarse, cancellation);
  std::vector<std::size_t> order(rough.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::stable_sort(order.begin(), order.end(),
                   [&rough](std::size_t a, std::size_t b) { return isBetter(rough[a], rough[b]); });
  std::vector<KeyframeStart> finalists;
  for (std::size_t i = 0; i < std::min(kFinalists, order.size()); ++i) {
    finalists.push_back({starts[order[i]].keyframe, rough[order[i]].T_O_C});
  }
  return aligner_->align(finalists, settings_.alignment, cancellation);
}

Refinement KeyframeFollower::conclude(HypothesisTable found, const Prior& prior) const {
  Refinement result;
  result.T_O_C = prior.T_O_C;
  result.hypotheses = std::move(found);
  if (result.hypotheses.empty() || result.hypotheses.front().state != HypothesisState::kLive) {
    const bool outside = !result.hypotheses.empty() &&
                         result.hypotheses.front().state == HypothesisState::kOutOfImage;
    result.outcome = outside ? Outcome::kNoOverlap : Outcome::kDiverged;
    return result;
  }
  const FieldMetadata& object = field_->field().metadata;
  result.hypotheses = nearestEquivalents(result.hypotheses, prior, object);
  const Hypothesis& best = result.hypotheses.front();
  result.outcome = Outcome::kRefined;
  result.T_O_C = {nearestRotation(best.T_O_C.R), best.T_O_C.t};
  result.visible_fraction = best.visible_fraction;
  result.score = keyframeScore(best.score, object.pose);
  result.covariance = poseCovariance(result.hypotheses, prior, object);
  return result;
}

}  // namespace nerf_pose_refiner
