// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/look_alike_watch.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "math/angle.h"
#include "refinement/covariance.h"
#include "refinement/look_alike_poses.h"
#include "refinement/pose_evidence.h"
#include "refinement/pose_probability.h"

namespace nerf_pose_refiner {
namespace {

// From one test to the use of its result, and so to the next one.
constexpr std::int64_t kTest_ns = 300000000;
constexpr double kKnown = 0.9;  // probability of the pose
// Logarithm of odds of one pose against another one, above which it is taken.
constexpr double kClearly = 3;

bool isNone(const Pose& motion) {
  return rotationDistance(motion.R, Eigen::Matrix3d::Identity()) == 0;
}

/// Whether an image alone fixes the turn of a pose.
bool fixesTurn(const LookAlikes& look_alikes, const LookAlikeEvidence& evidence) {
  LookAlikeBelief from_nothing(look_alikes, [](const Pose&) { return 1; });
  from_nothing.see(evidence);
  return from_nothing.right() > kKnown;
}

}  // namespace

struct LookAlikeWatch::Test {
  Test(ObjectImage image, std::int64_t at_ns, const Pose& T_O_C, const LookAlikes& look_alikes,
       bool sure)
      : test(std::move(image), T_O_C, look_alikes), stamp_ns(at_ns), is_sure(sure) {}

  LookAlikeTest test;  ///< of the renderer's thread until it is done
  std::int64_t stamp_ns;
  bool is_sure;          ///< the image shows the object at the pose
  bool is_valid = true;  ///< false: the pose has been corrected meanwhile
};

LookAlikeWatch::LookAlikeWatch(std::shared_ptr<const LoadedField> field,
                               const LookAlikes& look_alikes)
    : field_(std::move(field)), look_alikes_(look_alikes) {}

void LookAlikeWatch::begin(const Observation& observation, const Pose& T_O_C, const Prior& prior,
                           const CancellationToken& cancellation) {
  const FieldMetadata& object = field_->field().metadata;
  forget();
  belief_.emplace(look_alikes_,
                  [&](const Pose& motion) { return priorOdds(motion * T_O_C, prior, object); });
  auto image = objectImage(observation, T_O_C, object, kEvidence_px);
  if (!image) return;
  LookAlikeTest test(std::move(*image), T_O_C, look_alikes_);
  test.finish(*field_, cancellation);
  const LookAlikeEvidence evidence = test.evidence(noiseOf(object));
  holds_ = fixesTurn(look_alikes_, evidence);
  belief_->see(evidence);
}

void LookAlikeWatch::forget() {
  belief_.reset();
  last_.reset();
  guess_.reset();
  unexpected_rad_ = 0;
  if (test_) test_->is_valid = false;
}

Pose LookAlikeWatch::steadied(const Observation& observation, const Pose& expected,
                              const Pose& found, const KeyframePoints& keyframe) {
  constexpr double kSudden_rad = 3 * kDegree;
  if (!look_alikes_.axis) return found;
  const SymmetryAxis& axis = *look_alikes_.axis;
  const Eigen::Vector3d turn = logSO3(Eigen::Matrix3d(found.R * expected.R.transpose()));
  unexpected_rad_ += turn.dot(axis.direction);
  if (std::abs(unexpected_rad_) < kSudden_rad) return found;
  const Pose held = turnAbout(axis, -unexpected_rad_) * found;
  const FieldMetadata& object = field_->field().metadata;
  auto image = objectImage(observation, found, object, kEvidence_px);
  if (!image) return found;
  PoseEvidence comparison(std::move(*image));
  comparison.addAll(keyframe, {found, held});
  const bool is_turned = comparison.of(0, 1, noiseOf(object)) > kClearly;
  if (belief_) belief_->spread(0.5 * std::abs(unexpected_rad_));
  unexpected_rad_ = 0;
  return is_turned ? found : held;
}

std::optional<Pose> LookAlikeWatch::confirmed(const Observation& observation, const Pose& T_O_C,
                                              const Pose& motion,
                                              const CancellationToken& cancellation) const {
  constexpr double kBeside_deg[] = {0, -12, -6, 6, 12};  // tried turns are farther apart
  const FieldMetadata& object = field_->field().metadata;
  auto image = objectImage(observation, T_O_C, object, kEvidence_px);
  if (!image) return std::nullopt;
  PoseEvidence comparison(std::move(*image));
  std::vector<Pose> motions = {Pose()}, poses = {T_O_C};
  for (const double beside_deg : kBeside_deg) {
    motions.push_back(
        look_alikes_.axis ? turnAbout(*look_alikes_.axis, beside_deg * kDegree) * motion : motion);
    poses.push_back(motions.back() * T_O_C);
    if (!look_alikes_.axis) break;
  }
  comparison.addAll(*field_, poses, cancellation);
  double most = kClearly;
  std::optional<Pose> best;
  for (int i = 1; i < comparison.poses(); ++i) {
    const double evidence = comparison.of(i, 0, noiseOf(object));
    if (evidence <= most) continue;
    most = evidence;
    best = motions[i];
  }
  return best;
}

Pose LookAlikeWatch::withTurnOf(const Pose& other, const Pose& T_O_C) const {
  if (!look_alikes_.axis) return T_O_C;
  const SymmetryAxis& axis = *look_alikes_.axis;
  const Eigen::Vector3d turn = logSO3(Eigen::Matrix3d(T_O_C.R * other.R.transpose()));
  return turnAbout(axis, -turn.dot(axis.direction)) * T_O_C;
}

void LookAlikeWatch::goOn(std::int64_t stamp_ns, const Pose& T_O_C, bool is_sure) {
  constexpr double kRate = 2 * kDegree;  // [rad/s] of an object that stands still
  constexpr double kOfMotion = 0.25;     // of its rate of rotation
  constexpr double kHeldRate = 0.5 * kDegree;
  if (!belief_) belief_ = LookAlikeBelief::known(look_alikes_);
  if (last_ && stamp_ns > last_->first && look_alikes_.axis) {
    const double since_s = std::min(1.0, 1e-9 * static_cast<double>(stamp_ns - last_->first));
    const Eigen::Vector3d turn = logSO3(Eigen::Matrix3d(T_O_C.R * last_->second.R.transpose()));
    const double about_axis = std::abs(turn.dot(look_alikes_.axis->direction));
    // Where nothing shows the turn, it may go on at any rate like that of the object's motion; an
    // image that does not even show the object takes the pose wherever it may.
    const double rate = is_sure && holds_ ? kHeldRate : kRate + kOfMotion * turn.norm() / since_s;
    const double drift = rate * std::sqrt(since_s * 1.0);
    belief_->spread(is_sure ? drift : std::hypot(drift, about_axis));
  }
  last_ = {stamp_ns, T_O_C};
}

void LookAlikeWatch::takeTest(std::int64_t stamp_ns, bool wait, KeyframeRenderer* renderer,
                              const CancellationToken& cancellation) {
  guess_.reset();
  if (!test_) return;
  const bool began_anew = last_ && stamp_ns <= last_->first;
  if (stamp_ns < due_ns_ && !began_anew) return;
  if (!wait && renderer->isAsideBusy()) return;
  const std::shared_ptr<const Test> test = std::exchange(test_, nullptr);
  renderer->waitForAside(cancellation);
  if (test->is_valid && belief_) use(*test);
}

void LookAlikeWatch::use(const Test& test) {
  const LookAlikeEvidence evidence = test.test.evidence(noiseOf(field_->field().metadata));
  if (!test.is_sure) {
    LookAlikeBelief trial = *belief_;
    trial.see(evidence);
    const Pose motion = trial.better();
    if (!isNone(motion)) guess_ = motion;
    return;
  }
  holds_ = fixesTurn(look_alikes_, evidence);
  belief_->see(evidence);
  unexpected_rad_ = 0;
}

void LookAlikeWatch::giveTestUp(KeyframeRenderer* renderer) {
  renderer->endAside();  // also that of a test whose result was not waited for
  test_.reset();
}

/// Whether a test is under way that may still say something of the pose at a time.
bool LookAlikeWatch::isTesting(std::int64_t stamp_ns) const {
  constexpr std::int64_t kOldest_ns = 3000000000;
  return test_ && test_->is_valid && std::abs(stamp_ns - test_->stamp_ns) < kOldest_ns;
}

void LookAlikeWatch::maybeTest(const TimedObservation& image, const Pose& T_O_C, bool is_sure,
                               KeyframeRenderer* renderer) {
  if (!isTesting(image.stamp_ns)) {
    giveTestUp(renderer);
    beginTest(image, T_O_C, is_sure, renderer);
  }
  // While nobody knows which way the object is turned, its pose is of no use.
  const bool is_known = !belief_ || belief_->right() > kKnown;
  if (test_) renderer->goOnAside(test_->is_sure && !is_known);
}

void LookAlikeWatch::beginTest(const TimedObservation& image, const Pose& T_O_C, bool is_sure,
                               KeyframeRenderer* renderer) {
  const FieldMetadata& object = field_->field().metadata;
  auto part = objectImage(image.observation, T_O_C, object, kEvidence_px);
  if (!part) return;
  test_ = std::make_shared<Test>(std::move(*part), image.stamp_ns, T_O_C, look_alikes_, is_sure);
  due_ns_ = image.stamp_ns + kTest_ns;
  renderer->doAside([field = field_, test = test_](const CancellationToken& cancellation) {
    return test->test.step(*field, cancellation);
  });
}

std::optional<Pose> LookAlikeWatch::better() const {
  if (!belief_) return std::nullopt;
  const Pose motion = belief_->better();
  if (isNone(motion)) return std::nullopt;
  return motion;
}

void LookAlikeWatch::moveBy(const Pose& motion) {
  if (guess_) {
    belief_ = LookAlikeBelief::known(look_alikes_);  // what was known of the other pose is void
  } else if (belief_) {
    belief_->moveBy(motion);
  }
  guess_.reset();
  if (test_) test_->is_valid = false;
  last_.reset();
  unexpected_rad_ = 0;
}

void LookAlikeWatch::judge(Refinement* found) const {
  if (!belief_) {  // no image has shown which way it is turned
    found->unmistaken = 0;
    return;
  }
  constexpr double kLossTemperature = 0.05;  // @see hypothesisWeights
  const FieldMetadata& object = field_->field().metadata;
  found->unmistaken = belief_->right();
  if (look_alikes_.axis) {
    Vector6 turn;
    const SymmetryAxis& axis = *look_alikes_.axis;
    turn << axis.direction.cross(object.centre - axis.point), axis.direction;
    found->covariance += belief_->turnVariance() * turn * turn.transpose();
  }
  const Hypothesis best = found->hypotheses.front();
  for (const LookAlikeBelief::Other& other : belief_->others()) {
    Hypothesis hypothesis = moved(best, other.motion, object.centre);
    const double odds = other.probability / std::max(*found->unmistaken, 1e-6);
    hypothesis.loss -= kLossTemperature * std::max(std::abs(best.loss), 1e-9) * std::log(odds);
    found->hypotheses.push_back(hypothesis);
  }
}

}  // namespace nerf_pose_refiner
