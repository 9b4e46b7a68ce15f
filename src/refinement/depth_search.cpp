// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/depth_search.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "backend/common/plain_pose.h"
#include "math/angle.h"
#include "math/keyframe_search.h"
#include "refinement/start_poses.h"

namespace nerf_pose_refiner {
namespace {

bool hasMoreEvidence(const DepthFit& a, const DepthFit& b) { return a.evidence > b.evidence; }

}  // namespace

DepthSearch::DepthSearch(std::shared_ptr<const LoadedField> field, const ViewBankSettings& bank)
    : field_(std::move(field)), bank_(ViewBank::of(field_, bank)) {}

const DepthSearch::SmallView& DepthSearch::nearestView(const Pose& T_O_C,
                                                       const CancellationToken& cancellation) {
  constexpr int kFine = 500, kCoarse = 150;
  const int number = bank_->around(T_O_C, 0).front();
  const auto known = views_.find(number);
  if (known != views_.end()) return known->second;
  const KeyframePoints& keyframe = *bank_->view(number, cancellation);
  return views_
      .emplace(number,
               SmallView{depthSurfaceOf(keyframe, kFine), depthSurfaceOf(keyframe, kCoarse)})
      .first->second;
}

std::vector<DepthFit> DepthSearch::around(const DepthImage& depth, const DepthPrior& known,
                                          const Prior& prior,
                                          const CancellationToken& cancellation) {
  constexpr int kStarts = 160;
  constexpr std::size_t kMiddle = 12, kFinalists = 4;
  const FieldMetadata& object = field_->field().metadata;
  bank_->make(bank_->around(prior.T_O_C, 1.4 * prior.rotation_rad), cancellation);
  std::vector<DepthFit> rough, middle;
  for (const Pose& start : posesAround(prior, object, 1, kStarts)) {
    cancellation.check();
    rough.push_back(
        fitDepthAlone(nearestView(start, cancellation).coarse, depth, known, object, start));
  }
  for (const DepthFit& fit : bestOf(rough, kMiddle, object, hasMoreEvidence)) {
    middle.push_back(
        fitDepthAlone(nearestView(fit.T_O_C, cancellation).fine, depth, known, object, fit.T_O_C));
  }
  return bestOf(middle, kFinalists, object, hasMoreEvidence);
}

std::vector<DepthFit> DepthSearch::from(const DepthImage& depth, const DepthPrior& known,
                                        const std::shared_ptr<const KeyframePoints>& keyframe,
                                        const std::vector<Pose>& poses_T_O_C,
                                        const CancellationToken& cancellation) {
  if (keyframe != keyframe_) {
    keyframe_ = keyframe;
    surface_ = depthSurfaceOf(*keyframe);
  }
  const FieldMetadata& object = field_->field().metadata;
  std::vector<DepthFit> fits;
  if (surface_.places.size() < static_cast<std::size_t>(kFewestDepthPlaces)) return fits;
  for (const Pose& start : poses_T_O_C) {
    cancellation.check();
    fits.push_back(fitDepthAlone(surface_, depth, known, object, start));
  }
  return bestOf(fits, poses_T_O_C.size(), object, hasMoreEvidence);
}

std::vector<DepthFit> DepthSearch::beside(const DepthImage& depth, const DepthFit& found) const {
  constexpr double kRotation_rad = 5 * kDegree, kOffset = 0.05;  // that make a pose wrong
  constexpr double kApart = 2;                                   // of these
  const FieldMetadata& object = field_->field().metadata;
  Vector6 wrong;
  wrong << Eigen::Vector3d::Constant(kOffset * object.diameter),
      Eigen::Vector3d::Constant(kRotation_rad);
  const Matrix6 scaled = wrong.cwiseInverse().asDiagonal() *
                         withoutFreeTurn(found.covariance, object) *
                         wrong.cwiseInverse().asDiagonal();
  const Vector6 least = eigenOf(scaled).vectors.col(5);
  std::vector<DepthFit> others;
  for (const double by : {-kApart, kApart}) {
    const Vector6 x = by * wrong.cwiseProduct(least);
    DepthFit other;
    other.T_O_C = poseOf(moveCamera(plainPose(found.T_O_C), plainVector(object.centre),
                                    {x[0], x[1], x[2]}, {x[3], x[4], x[5]}));
    other.bias = found.bias;
    other.evidence = depthEvidence(surface_, depth, object, other.T_O_C, found.bias);
    others.push_back(other);
  }
  return others;
}

double depthProbability(const DepthFit& fit) {
  // A logistic curve between right poses and those that the objects of recordings/, plain bodies of
  // their sizes, walls and tables led to, as bench/depth_tracking shows them.
  constexpr double kInside = 10, kOutline = 15, kRelief = 4, kEven = 15;
  const double inside = shownFraction(fit.counts);
  const double outline = fractionOf(fit.counts.agreeing_edges, fit.counts.edges);
  const double relief = inside - fit.smooth;
  return 1 / (1 + std::exp(kEven - kInside * inside - kOutline * outline - kRelief * relief));
}

Matrix6 spreadOf(const std::vector<DepthFit>& fits, const FieldMetadata& object) {
  constexpr double kAlike = 0.1, kLeast = 2;  // of the best one's evidence; at least
  const DepthFit& best = fits.front();
  const double scale = std::max(kLeast, kAlike * best.evidence);
  Matrix6 spread = Matrix6::Zero();
  double sum = 0;
  for (const DepthFit& fit : fits) {
    const Pose other = nearestEquivalent(fit.T_O_C, best.T_O_C, object.symmetries);
    const Vector6 away = cameraTwist(best.T_O_C, other, object.centre);
    const double weight = std::min(1.0, std::exp((fit.evidence - best.evidence) / scale));
    spread += weight * away * away.transpose();
    sum += weight;
  }
  return spread / sum;
}

}  // namespace nerf_pose_refiner
