// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/look_alikes.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "backend/keyframe_aligner.h"
#include "math/angle.h"
#include "refinement/covariance.h"
#include "trust/look_alike_fit.h"
#include "trust/shown_sides.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kSides = 42, kImages = 10, kRolls = 10, kObject_px = 80;
constexpr double kDistance = 4;              // [diameters]
constexpr double kApart_rad = 20 * kDegree;  // nearer poses are nearly right

class ConfusionSearch {
 public:
  ConfusionSearch(Backend* backend, const LoadedField& field, const CancellationToken& cancellation)
      : object_(field.field().metadata),
        cancellation_(cancellation),
        aligner_(backend->makeKeyframeAligner()) {
    ViewBankSettings settings;
    settings.views = kSides;
    settings.object_px = kObject_px;
    settings.distance = kDistance;
    sides_ = renderSides(field, settings, cancellation);
    for (const ShownSide& side : sides_) keyframes_.push_back(aligner_->add(side.points));
  }

  std::vector<Confusion> find() {
    std::vector<Confusion> found;
    for (int i = 0; i < kImages; ++i) {
      for (const Pose& T_O_C : confusedIn(i * kSides / kImages)) {
        const Pose& truth = sides_[i * kSides / kImages].points->T_O_C;
        found.push_back({T_O_C * truth.inverse(), i});
      }
    }
    return found;
  }

 private:
  /// Poses far from the truth that explain an image of a side nearly as well.
  std::vector<Pose> confusedIn(int number) {
    constexpr double kMinOfRight = 0.7;
    constexpr std::size_t kFinalists = 24;
    const ShownSide& side = sides_[number];
    const Pose& truth = side.points->T_O_C;
    Observation observation;
    observation.camera = side.points->camera;
    observation.image = beforeClutter(side, static_cast<std::uint64_t>(keyframes_[number]));
    aligner_->observe(observation, frameWindowFor(*side.points, observation.camera, truth, 0.5));
    KeyframeAlignmentSettings rough;
    rough.finest_level = 1;
    rough.max_evaluations = 8;
    rough.observed_fraction = rough.coarse_observed_fraction;
    rough.convergence_px = rough.coarse_convergence_px;
    std::vector<Hypothesis> found = aligner_->align(startsBeside(number), rough, cancellation_);
    std::stable_sort(found.begin(), found.end(),
                     [](const Hypothesis& a, const Hypothesis& b) { return a.score > b.score; });
    std::vector<KeyframeStart> finalists = {{keyframes_[number], truth}};
    for (const Hypothesis& one : found) {
      if (finalists.size() > kFinalists) break;
      if (one.state == HypothesisState::kLive && isWrong(one.T_O_C, truth)) {
        finalists.push_back({nearestTo(one.T_O_C), one.T_O_C});
      }
    }
    found = aligner_->align(finalists, KeyframeAlignmentSettings(), cancellation_);
    std::vector<Pose> confused;
    for (std::size_t i = 1; i < found.size(); ++i) {
      const bool explains = found[i].state == HypothesisState::kLive &&
                            found[i].score >= kMinOfRight * found.front().score;
      if (explains && isWrong(found[i].T_O_C, truth)) {
        confused.emplace_back(nearestRotation(found[i].T_O_C.R), found[i].T_O_C.t);
      }
    }
    return confused;
  }

  /// The other sides in place of one, turned about the line of sight.
  std::vector<KeyframeStart> startsBeside(int number) const {
    std::vector<KeyframeStart> starts;
    const Pose& truth = sides_[number].points->T_O_C;
    for (int j = 0; j < kSides; ++j) {
      const Pose& other = sides_[j].points->T_O_C;
      for (int k = 0; k < kRolls; ++k) {
        const Eigen::Matrix3d roll =
            expSO3(Eigen::Vector3d(0, 0, 2 * M_PI * k / kRolls));  // about the camera's axis
        const Pose start = {nearestRotation(other.R * roll), other.t};
        if (isWrong(start, truth)) starts.push_back({keyframes_[j], start});
      }
    }
    return starts;
  }

  int nearestTo(const Pose& T_O_C) const {
    const Eigen::Vector3d sight = (T_O_C.t - object_.centre).normalized();
    const auto closeness = [&](const ShownSide& side) {
      return (side.points->T_O_C.t - object_.centre).normalized().dot(sight);
    };
    const auto nearest = std::max_element(
        sides_.begin(), sides_.end(),
        [&](const ShownSide& a, const ShownSide& b) { return closeness(a) < closeness(b); });
    return keyframes_[nearest - sides_.begin()];
  }

  bool isWrong(const Pose& T_O_C, const Pose& truth) const {
    const Pose nearest = nearestEquivalent(T_O_C, truth, object_.symmetries);
    return rotationDistance(nearest.R, truth.R) > kApart_rad;
  }

  const FieldMetadata& object_;
  const CancellationToken& cancellation_;
  std::unique_ptr<KeyframeAligner> aligner_;
  std::vector<ShownSide> sides_;
  std::vector<int> keyframes_;  // of the sides, in the aligner
};

}  // namespace

LookAlikes measureLookAlikes(Backend* backend, const LoadedField& field,
                             const CancellationToken& cancellation) {
  return fitLookAlikes(ConfusionSearch(backend, field, cancellation).find(),
                       field.field().metadata);
}

std::string describe(const LookAlikes& known) {
  std::string text = known.axis ? "any turn about an axis" : "";
  if (!known.motions.empty()) {
    text += (text.empty() ? "" : " and ") + std::to_string(known.motions.size()) + " other motions";
  }
  return text;
}

LookAlikes lookAlikesOf(Backend* backend, const LoadedField& field,
                        const CancellationToken& cancellation) {
  const LookAlikes& known = field.field().metadata.look_alikes;
  return known.measured ? known : measureLookAlikes(backend, field, cancellation);
}

}  // namespace nerf_pose_refiner
