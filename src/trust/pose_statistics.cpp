// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/pose_statistics.h"

#include <algorithm>
#include <cmath>
#include <memory>

#include "math/random.h"
#include "refinement/field_refiner.h"
#include "trust/keyframe_scores.h"
#include "trust/pose_errors.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::uint64_t kSeed = 1;
enum Stream : std::uint64_t { kTurn = 1, kMove, kWrongAxis, kWrongAngle };

constexpr double kStartRotation_rad = 0.03;                      // a little off
constexpr double kStartTranslation = 0.02;                       // [diameters]
constexpr std::uint64_t kWrongDraws = 8, kDrawStride = 1 << 20;  // beyond any view's number

Eigen::Vector3d randomVector(Stream stream, std::uint64_t index) {
  Eigen::Vector3d v;
  for (int a = 0; a < 3; ++a) v[a] = 2 * randomUniform(kSeed, stream, 3 * index + a) - 1;
  return v;
}

/// The camera turned about the object's centre.
Pose turned(const Pose& T_O_C, const Eigen::Vector3d& w, const Eigen::Vector3d& centre) {
  const Eigen::Matrix3d turn = expSO3(w);
  return {turn * T_O_C.R, centre + turn * (T_O_C.t - centre)};
}

Pose littleOff(const Pose& T_O_C, const FieldMetadata& object, std::uint64_t index) {
  Pose off = turned(T_O_C, kStartRotation_rad * randomVector(kTurn, index), object.centre);
  off.t += kStartTranslation * object.diameter * randomVector(kMove, index);
  return off;
}

/// By 60 to 180 degrees.
Pose turnedFar(const Pose& T_O_C, const FieldMetadata& object, std::uint64_t index) {
  const double angle = 1.05 + 2.09 * randomUniform(kSeed, kWrongAngle, index);
  return turned(T_O_C, angle * randomVector(kWrongAxis, index).normalized(), object.centre);
}

/// The same; of an object with symmetries the one of a few that looks least like the view.
Pose wrongSide(const Pose& T_O_C, const FieldMetadata& object, std::uint64_t index) {
  Pose wrong = turnedFar(T_O_C, object, index);
  if (!object.symmetries.any()) return wrong;
  const auto distance = [&](const Pose& pose) {
    return rotationDistance(nearestEquivalent(pose, T_O_C, object.symmetries).R, T_O_C.R);
  };
  for (std::uint64_t i = 1; i < kWrongDraws; ++i) {
    const Pose other = turnedFar(T_O_C, object, index + i * kDrawStride);
    if (distance(other) > distance(wrong)) wrong = other;
  }
  return wrong;
}

double mean(const std::vector<double>& values) {
  double sum = 0;
  for (const double value : values) sum += value;
  return values.empty() ? 0 : sum / static_cast<double>(values.size());
}

/// Whether a refinement ended nearer to the truth than it began: errors are those of found poses.
bool isFound(const Refinement& refinement, const Pose& true_T_O_C, const FieldMetadata& object) {
  if (refinement.outcome != Outcome::kRefined) return false;
  const Pose T_O_C = nearestEquivalent(refinement.T_O_C, true_T_O_C, object.symmetries);
  const Vector6 error = cameraTwist(T_O_C, true_T_O_C, object.centre);
  return error.head<3>().norm() < kStartTranslation * object.diameter &&
         error.tail<3>().norm() < kStartRotation_rad;
}

}  // namespace

PoseStatistics measurePoses(Backend* backend, const LoadedField& field,
                            const std::vector<PosedView>& views,
                            const CancellationToken& cancellation) {
  const FieldMetadata& object = field.field().metadata;
  const std::shared_ptr<Backend> borrowed(backend, [](Backend*) {});
  FieldRefiner refiner(borrowed, RefinerSettings::named("track"));
  std::vector<double> right, wrong;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const Pose& truth = views[i].T_O_C;
    const Observation observation = beforeClutter(premultiply(*views[i].rgba), views[i].camera, i);
    Prior prior;
    prior.rotation_rad = 2 * kStartRotation_rad;
    prior.translation = 2 * kStartTranslation;
    prior.T_O_C = littleOff(truth, object, i);
    const Refinement found = refiner.refine(field, observation, prior, cancellation);
    prior.T_O_C = wrongSide(truth, object, i);
    const Refinement mistaken = refiner.refine(field, observation, prior, cancellation);
    if (found.outcome == Outcome::kCancelled || mistaken.outcome == Outcome::kCancelled)
      cancellation.check();
    if (mistaken.outcome == Outcome::kRefined) wrong.push_back(mistaken.hypotheses.front().score);
    if (isFound(found, truth, object)) right.push_back(found.hypotheses.front().score);
  }
  PoseStatistics statistics;
  statistics.views = static_cast<int>(right.size());
  statistics.right_score = mean(right);
  statistics.wrong_score = mean(wrong);
  statistics.keyframes = measureKeyframeScores(backend, field, cancellation);
  return statistics;
}

}  // namespace nerf_pose_refiner
