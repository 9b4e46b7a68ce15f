// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/depth_fit.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "backend/common/plain_pose.h"
#include "math/median.h"
#include "math/robust.h"

namespace nerf_pose_refiner {
namespace {

// Unknowns: (v, w), the sensor's bias, and how much wider it shows the object [px].
constexpr int kBias = 6, kWidening = 7, kUnknowns = 8;
using MatrixN = Eigen::Matrix<double, kUnknowns, kUnknowns>;
using VectorN = Eigen::Matrix<double, kUnknowns, 1>;

// Windows that are matched reach over edges: what is nearer looks wider by so much [px].
constexpr double kWidening_px = 0.7, kWideningVariance_px2 = 0.7 * 0.7;

// Errors of the learned surface, which all places share in part, beside the sensor's [variances].
constexpr double kOverNoise = 2.5;

/// Sums of the normal equations.
struct DepthSystem {
  MatrixN information = MatrixN::Zero(), scatter = MatrixN::Zero();
  VectorN gradient = VectorN::Zero();
  double tiles = 0;  ///< how many, were they equal
};

class DepthFitter {
 public:
  DepthFitter(const DepthSurface& surface, const DepthImage& depth, const DepthPrior& prior,
              const FieldMetadata& object)
      : surface_(surface),
        depth_(depth),
        prior_(prior),
        object_(object),
        comparison_(surface, depth, object) {}

  DepthFit fit();
  DepthFit fitAlone(const Pose& start_T_O_C);
  double evidenceAt(const Pose& T_O_C);

 private:
  /// How far a residual may be off to have a say [deviations; px].
  struct Scale {
    double place, edge_px;
  };

  DepthFit begin() const;
  double noiseScale() const;
  double independence() const;
  double outlineIndependence() const;
  DepthSystem sum(const Scale& scale) const;
  bool step(const Scale& scale);
  double evidence() const;
  void conclude();

  const DepthSurface& surface_;
  const DepthImage& depth_;
  const DepthPrior& prior_;
  const FieldMetadata& object_;
  DepthComparison comparison_;
  bool by_outline_ = false;
  Matrix6 information_ = Matrix6::Zero();  // of the prior
  DepthFit fit_;
  double widening_ = kWidening_px;
};

// How much larger errors are than the noise model says; never smaller.
double DepthFitter::noiseScale() const {
  constexpr double kOutlier = 8, kOfMedian = 0.6745, kMax = 3;
  std::vector<double> errors;
  for (const ComparedDepth& c : comparison_.places()) {
    const double error = std::abs(c.plane.depth + fit_.bias - c.measured) / c.deviation;
    if (error < kOutlier) errors.push_back(error);
  }
  return std::clamp(medianOf(errors) / kOfMedian, 1.0, kMax);
}

/// What a place says, beside what it would if its error were its own.
double DepthFitter::independence() const {
  const double apart_px = comparison_.spacing_px() / depth_.noise.correlation_px;
  return std::min(1.0, apart_px * apart_px) / kOverNoise;
}

/// The same of a place of the outline.
double DepthFitter::outlineIndependence() const {
  return std::min(1.0, comparison_.outlineSpacing_px() / depth_.noise.correlation_px) / kOverNoise;
}

DepthSystem DepthFitter::sum(const Scale& scale) const {
  DepthSystem system;
  std::vector<VectorN> of_tile(surface_.tiles, VectorN::Zero());
  std::vector<double> tile_weight(surface_.tiles, 0.0);
  const auto add = [&](const VectorN& jacobian, double residual, double weight, int tile) {
    system.information += weight * jacobian * jacobian.transpose();
    of_tile[tile] += weight * residual * jacobian;
    tile_weight[tile] += weight;
  };
  VectorN jacobian = VectorN::Zero();
  const double noise = noiseScale(), share = independence();
  for (const ComparedDepth& c : comparison_.places()) {
    const double deviation = noise * c.deviation;
    const double residual = (c.plane.depth + fit_.bias - c.measured) / deviation;
    const RobustTerm<double> robust = gemanMcClure(residual * residual, scale.place);
    for (int k = 0; k < 6; ++k) jacobian[k] = c.plane.jacobian[k] / deviation;
    jacobian[kBias] = 1 / deviation;
    add(jacobian, residual, share * robust.weight, c.tile);
  }
  jacobian.setZero();
  const double outline_share = outlineIndependence();
  for (const ComparedEdge& c : comparison_.edges()) {
    if (c.edge.kind != DepthEdge::Kind::kFound) continue;
    const double deviation = c.edge.deviation_px;
    const double residual = (widening_ - c.edge.offset_px) / deviation;
    const RobustTerm<double> robust = gemanMcClure(residual * residual, scale.edge_px / deviation);
    for (int k = 0; k < 6; ++k) jacobian[k] = c.jacobian[k] / deviation;
    jacobian[kWidening] = 1 / deviation;
    add(jacobian, residual, outline_share * robust.weight, c.tile);
  }
  for (const VectorN& gradient : of_tile) {
    system.gradient += gradient;
    system.scatter += gradient * gradient.transpose();
  }
  double weight = 0, squared = 0;
  for (const double of_one : tile_weight) {
    weight += of_one;
    squared += of_one * of_one;
  }
  system.tiles = squared > 0 ? weight * weight / squared : 0;
  return system;
}

/// A Gauss-Newton step. @return whether it was worth taking.
bool DepthFitter::step(const Scale& scale) {
  constexpr double kShort = 1e-3;  // [prior deviations]
  comparison_.compare(fit_.T_O_C, fit_.bias, by_outline_);
  DepthSystem system = sum(scale);
  const Vector6 away = cameraTwist(prior_.T_O_C, fit_.T_O_C, object_.centre);
  system.information.topLeftCorner<6, 6>() += information_;
  system.information(kBias, kBias) += 1 / prior_.bias_variance;
  system.information(kWidening, kWidening) += 1 / kWideningVariance_px2;
  system.gradient.head<6>() += information_ * away;
  system.gradient[kBias] += (fit_.bias - prior_.bias) / prior_.bias_variance;
  system.gradient[kWidening] += (widening_ - kWidening_px) / kWideningVariance_px2;
  const VectorN x = -system.information.ldlt().solve(system.gradient);
  if (!x.allFinite()) return false;
  const Vec3<double> v = {x[0], x[1], x[2]}, w = {x[3], x[4], x[5]};
  fit_.T_O_C = poseOf(moveCamera(plainPose(fit_.T_O_C), plainVector(object_.centre), v, w));
  fit_.bias += x[kBias];
  widening_ += x[kWidening];
  const double length = x.head<6>().dot(information_ * x.head<6>());
  return length + x[kBias] * x[kBias] / prior_.bias_variance > kShort * kShort;
}

/// By the logarithms of likelihood ratios: depth where the pose puts it against depth anywhere
/// within the diameter. Something may stand before the object; it is hardly ever seen through.
double DepthFitter::evidence() const {
  constexpr double kMissed = 0.02, kHidden = 0.2, kEdge = 1.5;
  const double anywhere = 2 * object_.diameter;
  double of_places = 0, of_edges = 0;
  const double noise = noiseScale();
  for (const ComparedDepth& c : comparison_.places()) {
    const double deviation = noise * c.deviation;
    const double residual = (c.plane.depth + fit_.bias - c.measured) / deviation;
    const double density = std::exp(-0.5 * residual * residual) / (std::sqrt(2 * M_PI) * deviation);
    of_places += std::log(density * anywhere + (residual > 0 ? kHidden : kMissed));
  }
  const int edges = static_cast<int>(comparison_.edges().size());
  const int agreeing = comparison_.count(fit_.bias).agreeing_edges;
  of_edges = kEdge * (2 * agreeing - edges);
  return independence() * of_places + outlineIndependence() * of_edges;
}

void DepthFitter::conclude() {
  comparison_.compare(fit_.T_O_C, fit_.bias, by_outline_);
  fit_.counts = comparison_.count(fit_.bias);
  const DepthSystem system = sum({kDepthAgrees, kDepthAgrees});
  MatrixN known = MatrixN::Zero();
  known.topLeftCorner<6, 6>() = information_;
  known(kBias, kBias) = 1 / prior_.bias_variance;
  known(kWidening, kWidening) = 1 / kWideningVariance_px2;
  // The sandwich estimate, as of colours: the scatter of tiles has what the noise model leaves out,
  // but is itself uncertain where there are few.
  const Eigen::LDLT<MatrixN> bread(system.information + known);
  const double spare =
      1 - kUnknowns / std::max(2.0 * kUnknowns, system.tiles);  // each was made small by its own
  const MatrixN meat = known + 0.5 * (system.information + system.scatter / (spare * spare));
  const MatrixN half = bread.solve(meat);
  MatrixN covariance = bread.solve(half.transpose());
  covariance = (0.5 * (covariance + covariance.transpose())).eval();
  fit_.covariance = covariance.topLeftCorner<6, 6>();
  fit_.bias_variance = covariance(kBias, kBias);
  const Vector6 away = cameraTwist(prior_.T_O_C, fit_.T_O_C, object_.centre);
  const double off = fit_.bias - prior_.bias;
  fit_.squared_distance = away.dot(information_ * away) + off * off / prior_.bias_variance;
}

DepthFit DepthFitter::begin() const {
  DepthFit fit;
  fit.T_O_C = prior_.T_O_C;
  fit.bias = prior_.bias;
  fit.covariance = prior_.covariance;
  fit.bias_variance = prior_.bias_variance;
  return fit;
}

DepthFit DepthFitter::fit() {
  constexpr int kMaxSteps = 8;
  fit_ = begin();
  comparison_.findHidden(prior_.T_O_C);
  comparison_.compare(prior_.T_O_C, prior_.bias, by_outline_);
  fit_.before = fit_.counts = comparison_.count(prior_.bias);
  if (!comparison_.ratios().empty()) fit_.median_ratio = medianOf(comparison_.ratios());
  if (comparison_.places().empty()) return fit_;
  information_ = inverseOf(prior_.covariance);
  const Eigen::Vector3d sight = (prior_.T_O_C.t - object_.centre).normalized();
  const double along =
      std::sqrt(sight.dot(prior_.covariance.topLeftCorner<3, 3>() * sight) + prior_.bias_variance);
  // All that the prior leaves open counts at first.
  double scale = kDepthAgrees + 2 * along / comparison_.places().front().deviation;
  for (int i = 0; i < kMaxSteps; ++i) {
    const bool goes_on = step({scale, kDepthAgrees});
    if (!goes_on && scale == kDepthAgrees) break;
    scale = scale < 1.2 * kDepthAgrees ? kDepthAgrees : 0.5 * (scale + kDepthAgrees);
  }
  conclude();
  return fit_;
}

DepthFit DepthFitter::fitAlone(const Pose& start_T_O_C) {
  constexpr int kMaxSteps = 12;
  constexpr double kReach = 0.08;  // [diameters]
  by_outline_ = true;
  fit_ = begin();
  fit_.T_O_C = start_T_O_C;
  comparison_.findHidden(start_T_O_C);
  comparison_.compare(start_T_O_C, fit_.bias, by_outline_);
  fit_.before = fit_.counts = comparison_.count(fit_.bias);
  fit_.evidence = -std::numeric_limits<double>::max();
  if (comparison_.places().empty()) return fit_;
  information_ = inverseOf(prior_.covariance);
  const double reach = kReach * object_.diameter / comparison_.places().front().deviation;
  Scale scale = {std::max(kDepthAgrees, reach), kEdgeReach_px};
  for (int i = 0; i < kMaxSteps; ++i) {
    const bool goes_on = step(scale);
    if (!goes_on && scale.place == kDepthAgrees) break;
    scale.place = scale.place < 1.2 * kDepthAgrees ? kDepthAgrees : 0.7 * scale.place;
    scale.edge_px = std::max(kDepthAgrees, 0.8 * scale.edge_px);
  }
  conclude();
  fit_.evidence = evidence();
  fit_.smooth = comparison_.smoothAgreement();
  return fit_;
}

double DepthFitter::evidenceAt(const Pose& T_O_C) {
  fit_.bias = prior_.bias;
  comparison_.findHidden(T_O_C);
  comparison_.compare(T_O_C, fit_.bias, true);
  return evidence();
}

}  // namespace

Matrix6 withoutFreeTurn(const Matrix6& covariance, const FieldMetadata& object) {
  constexpr double kHeld_rad = 1e-3;
  const std::optional<SymmetryAxis>& axis = object.symmetries.axis();
  if (!axis) return covariance;
  Matrix6 held = withoutTurns(*axis, covariance, object.centre);
  const Eigen::Vector3d& d = axis->direction;
  held.bottomRightCorner<3, 3>() += kHeld_rad * kHeld_rad * d * d.transpose();
  held.topLeftCorner<3, 3>().diagonal().array() += 1e-12 * object.diameter * object.diameter;
  return held;
}

DepthFit fitDepth(const DepthSurface& surface, const DepthImage& depth, const DepthPrior& prior,
                  const FieldMetadata& object) {
  return DepthFitter(surface, depth, prior, object).fit();
}

DepthFit fitDepthAlone(const DepthSurface& surface, const DepthImage& depth,
                       const DepthPrior& prior, const FieldMetadata& object,
                       const Pose& start_T_O_C) {
  return DepthFitter(surface, depth, prior, object).fitAlone(start_T_O_C);
}

double depthEvidence(const DepthSurface& surface, const DepthImage& depth,
                     const FieldMetadata& object, const Pose& T_O_C, double bias) {
  DepthPrior known;
  known.bias = bias;
  return DepthFitter(surface, depth, known, object).evidenceAt(T_O_C);
}

}  // namespace nerf_pose_refiner
