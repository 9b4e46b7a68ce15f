// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/pose_errors.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>

#include "backend/keyframe_aligner.h"
#include "geometry/line_of_sight.h"
#include "image/colour.h"
#include "image/resample.h"
#include "math/angle.h"
#include "math/random.h"
#include "refinement/covariance.h"
#include "refinement/keyframe_settings.h"
#include "refinement/look_alike_poses.h"
#include "refinement/pose_probability.h"
#include "trust/clutter_blocks.h"
#include "trust/other_light.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::uint64_t kErrorSeed = 11;
enum ErrorStream : std::uint64_t { kBesideAxis, kStartTurn, kStartMove, kLightFrom };

constexpr float kLight = 0.6f;  // of the logarithm of brightness, from one side or the other
constexpr double kStartTurn_rad = 0.03, kStartOffset = 0.02;       // of starts [., diameters]
constexpr double kElsewhere_rad = 5 * kDegree, kElsewhere = 0.05;  // errors above are failures
constexpr int kMinErrors = 4;                                      // fewer tell nothing

Eigen::Vector3d drawn(ErrorStream stream, std::uint64_t index) {
  Eigen::Vector3d v;
  for (int a = 0; a < 3; ++a) v[a] = 2 * randomUniform(kErrorSeed, stream, 3 * index + a) - 1;
  return v;
}

/// The camera turned about the object's centre.
Pose aroundCentre(const Pose& T_O_C, const Eigen::Vector3d& turn, const FieldMetadata& object) {
  const Eigen::Matrix3d R = expSO3(turn);
  return {nearestRotation(R * T_O_C.R), object.centre + R * (T_O_C.t - object.centre)};
}

/// A hypothesis moved to the pose nearest to the truth of those that it may be taken for.
Hypothesis comparable(const HypothesisTable& found, const Pose& true_T_O_C,
                      const FieldMetadata& object) {
  Prior truth;
  truth.T_O_C = true_T_O_C;
  const Hypothesis nearest = nearestEquivalents(found, truth, object).front();
  if (!object.look_alikes.axis) return nearest;
  const SymmetryAxis& axis = *object.look_alikes.axis;
  const Eigen::Vector3d turn = logSO3(Eigen::Matrix3d(nearest.T_O_C.R * true_T_O_C.R.transpose()));
  return moved(nearest, turnAbout(axis, -turn.dot(axis.direction)), object.centre);
}

/// A photo, cut out, no larger than images of robots are.
PremultipliedImage reduced(const PosedView& view, Camera* camera) {
  constexpr double kMax_px = 800;
  *camera = view.camera;
  PremultipliedImage photo = premultiply(*view.rgba);
  const double scale = kMax_px / std::max(camera->width, camera->height);
  if (scale >= 1) return photo;
  *camera = camera->scaled(scale);
  photo.colour = resample(photo.colour, view.camera, *camera);
  photo.alpha = resample(photo.alpha, view.camera, *camera);
  return photo;
}

class ErrorTrials {
 public:
  ErrorTrials(Backend* backend, const LoadedField& field, const CancellationToken& cancellation)
      : field_(field), cancellation_(cancellation), aligner_(backend->makeKeyframeAligner()) {}

  /// Aligns a keyframe from beside with an image of a known pose.
  void tryOne(const Observation& observation, const Pose& true_T_O_C, std::uint64_t index) {
    const FieldMetadata& object = field_.field().metadata;
    const View view = {observation.camera, besidePose(true_T_O_C, index)};
    if (!fitsKeyframe(view, object)) return;
    const auto keyframe = std::make_shared<const KeyframePoints>(
        renderKeyframe(field_, view, settings_.keyframe, cancellation_));
    Prior prior;
    prior.T_O_C = aroundCentre(true_T_O_C, kStartTurn_rad * drawn(kStartTurn, index), object);
    prior.T_O_C.t += kStartOffset * object.diameter * drawn(kStartMove, index);
    prior.rotation_rad = 2 * kStartTurn_rad;
    prior.translation = 2 * kStartOffset;
    aligner_->observe(observation, frameWindowFor(*keyframe, view.camera, prior.T_O_C));
    const int number = aligner_->add(keyframe);
    const HypothesisTable found =
        aligner_->align({{number, prior.T_O_C}}, settings_.alignment, cancellation_);
    aligner_->remove(number);
    if (found.front().state == HypothesisState::kLive) note(found, prior, true_T_O_C);
  }

  void write(PoseStatistics* statistics) const {
    if (found_ < kMinErrors) {  // what fails nearly everywhere is not known to err little
      statistics->lateral = statistics->depth = kElsewhere;
      statistics->tilt_rad = statistics->roll_rad = kElsewhere_rad;
      return;
    }
    statistics->lateral = lateral_.deviation();
    statistics->depth = depth_.deviation();
    statistics->tilt_rad = tilt_.deviation();
    statistics->roll_rad = roll_.deviation();
  }

 private:
  /// As far beside, and as much nearer or farther, as the nearest keyframe may be.
  Pose besidePose(const Pose& true_T_O_C, std::uint64_t index) const {
    const FieldMetadata& object = field_.field().metadata;
    const Eigen::Vector3d sight = object.centre - true_T_O_C.t;
    const Eigen::Vector3d turn = settings_.renew_rotation_deg * kDegree *
                                 sight.cross(drawn(kBesideAxis, index)).normalized();
    Pose beside = aroundCentre(true_T_O_C, turn, object);
    const double farther = (index / 2 % 2 == 0 ? 1 : -1) * settings_.renew_distance;
    beside.t = object.centre + (1 + farther) * (beside.t - object.centre);
    return beside;
  }

  /// Errors across and along the line of sight, in the units of PoseStatistics. Ends elsewhere are
  /// no errors but failures, which scores tell.
  void note(const HypothesisTable& found, const Prior& prior, const Pose& true_T_O_C) {
    const FieldMetadata& object = field_.field().metadata;
    const HypothesisTable table = {comparable(found, true_T_O_C, object)};
    const Pose& T_O_C = table.front().T_O_C;
    const Vector6 twist = cameraTwist(T_O_C, true_T_O_C, object.centre);
    const bool is_found = twist.head<3>().norm() < kElsewhere * object.diameter &&
                          twist.tail<3>().norm() < kElsewhere_rad;
    if (!is_found) return;
    ++found_;
    Matrix6 covariance = keyframeCovariance(table, prior, object);
    const std::optional<SymmetryAxis> axis = axisOfLikeTurns(object);
    if (axis) covariance = withoutTurns(*axis, covariance, object.centre);
    const Eigen::Vector3d centre_C = T_O_C.inverse() * object.centre;
    const Eigen::Matrix3d sight = T_O_C.R * lineOfSightAxes(centre_C);
    Matrix6 to_sight = rotationOfTwists(sight.transpose());
    to_sight.topRows<2>() /= object.diameter;
    to_sight.row(2) /= centre_C.norm();
    const Vector6 error = to_sight * twist;
    const Vector6 expected = (to_sight * covariance * to_sight.transpose()).diagonal();
    // Deviations are those with keyframes of a pose's own place.
    const double factor = besideFactor(found.front().beside_rad);
    ExcessError* const of_row[] = {&lateral_, &lateral_, &depth_, &tilt_, &tilt_, &roll_};
    for (int row = 0; row < 6; ++row) {
      double share = factor;
      if (axis && row >= 3) {  // without turns about an axis, less is left of those near it
        const double along = sight.col(row - 3).dot(axis->direction);
        if (std::abs(along) > 0.9) continue;
        share *= 1 - along * along;
      }
      of_row[row]->add(error[row] / std::sqrt(share), expected[row] / share);
    }
  }

  const LoadedField& field_;
  const CancellationToken& cancellation_;
  KeyframeSearchSettings settings_;
  std::unique_ptr<KeyframeAligner> aligner_;
  ExcessError lateral_, depth_, tilt_, roll_;
  int found_ = 0;
};

}  // namespace

Observation beforeClutter(const PremultipliedImage& photo, const Camera& camera,
                          std::uint64_t index) {
  const Image behind = clutterBlocks(camera, index);
  Observation observation;
  observation.camera = camera;
  observation.image = photo.colour;
  for (std::size_t i = 0; i < behind.values.size(); ++i) {
    observation.image.values[i] += (1 - photo.alpha.values[i / 3]) * behind.values[i];
  }
  return observation;
}

void ExcessError::add(double error, double expected_variance) {
  errors_.push_back({error * error, expected_variance});
}

/// The mean of errors squared in their variances, if each has so much more. Outliers count as three
/// deviations, which leaves a Gaussian's mean at 1.
double ExcessError::meanBeside(double variance) const {
  constexpr double kMin = 1e-18;  // nothing is exact
  constexpr double kMax = 9;
  double sum = 0;
  for (const Error& one : errors_) {
    sum += std::min(kMax, one.squared / (one.expected + variance + kMin));
  }
  return sum / static_cast<double>(errors_.size());
}

double ExcessError::deviation() const {
  constexpr int kHalvings = 60;
  if (errors_.size() < kMinErrors) return 0;
  // An estimate from n errors is poor: the variance of those that are to come is larger by
  // n / (n - 2), as in Student's distribution. And a robot's images are less like the model than
  // photos that it was learned from: shadows, other sharpness.
  constexpr double kUnlikePhotos = 1.3;
  const auto count = static_cast<double>(errors_.size());
  const double wanted = (count - 2) / count / kUnlikePhotos;
  if (meanBeside(0) <= wanted) return 0;
  double low = 0, high = 0;
  for (const Error& one : errors_) high = std::max(high, 2 * count * one.squared);
  for (int i = 0; i < kHalvings; ++i) {
    const double middle = 0.5 * (low + high);
    (meanBeside(middle) > wanted ? low : high) = middle;
  }
  return std::sqrt(high);
}

void measurePoseErrors(Backend* backend, const LoadedField& field,
                       const std::vector<PosedView>& views, const CancellationToken& cancellation,
                       PoseStatistics* statistics) {
  ErrorTrials trials(backend, field, cancellation);
  for (std::size_t i = 0; i < views.size(); ++i) {
    cancellation.check();
    Camera camera;
    const PremultipliedImage photo = reduced(views[i], &camera);
    Observation observation = beforeClutter(photo, camera, i);
    if (i % 2 == 1) {
      const Rendering shape = field.render({camera, views[i].T_O_C}, RenderOptions(), cancellation);
      relight(shape, kLight * drawn(kLightFrom, i).normalized().cast<float>(), &observation.image);
    }
    trials.tryOne(observation, views[i].T_O_C, i);
  }
  trials.write(statistics);
}

}  // namespace nerf_pose_refiner
