// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/depth_fit.h"

#include <Eigen/Cholesky>

#include <algorithm>
#include <cmath>
#include <vector>

#include "backend/common/plain_pose.h"
#include "backend/common/self_occlusion.h"
#include "math/keyframe_search.h"
#include "math/robust.h"

namespace nerf_pose_refiner {
namespace {

using Matrix7 = Eigen::Matrix<double, 7, 7>;
using Vector7 = Eigen::Matrix<double, 7, 1>;

constexpr double kAgreeing = 3;          // residuals below it agree [deviations]
constexpr double kSurfaceError = 0.004;  // deviation of the learned surface [diameters]
// What a pixel shows lies beside it by so much (Nguyen, Izadi, Lovell 2012), the more on windows
// that reach over edges.
constexpr double kLateral_px = 0.8;
constexpr int kMaxSteps = 8;

/// A place of the surface, compared with its pixel; lengths in model units.
struct ComparedDepth {
  PlaneDepth<double> plane;
  double measured, deviation;
  int tile;
};

double medianOf(std::vector<double> values) {
  if (values.empty()) return 0;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Sums of the normal equations for (v, w, bias).
struct DepthSystem {
  Matrix7 information = Matrix7::Zero(), scatter = Matrix7::Zero();
  Vector7 gradient = Vector7::Zero();
  double tiles = 0;  ///< how many, were they equal
};

class DepthFitter {
 public:
  DepthFitter(const DepthSurface& surface, const DepthImage& depth, const FieldMetadata& object)
      : surface_(surface), depth_(depth), object_(object), unit_m_(object.metres_per_unit) {
    T_C_D_ = depth.T_C_D;
    T_C_D_.t /= unit_m_;
    K_ = {depth.camera.fx, depth.camera.fy, depth.camera.cx, depth.camera.cy};
  }

  DepthFit fit(const DepthPrior& prior);

 private:
  void findHidden(const Pose& T_O_C);
  void compare(const Pose& T_O_C);
  void comparePlace(const PointTransform<double>& in_depth, std::size_t i);
  bool isAtEdge(int x, int y, float centre_m) const;
  DepthCounts count(double bias) const;
  double noiseScale(double bias) const;
  DepthSystem sum(double bias, double scale) const;
  double independence() const;
  bool step(const DepthPrior& prior, const Matrix6& information, double scale, DepthFit* fit);
  void conclude(const DepthPrior& prior, const Matrix6& information, DepthFit* fit);

  const DepthSurface& surface_;
  const DepthImage& depth_;
  const FieldMetadata& object_;
  double unit_m_;
  Pose T_C_D_;  // [model units]
  Pinhole<double> K_;
  std::vector<char> is_hidden_;  // of each place: the object hides it itself
  // Of the pose that was compared last:
  std::vector<ComparedDepth> compared_;
  std::vector<double> ratios_;  // measured by expected, at edges, too
  int facing_ = 0;
};

// Pixels between two surfaces show neither.
bool DepthFitter::isAtEdge(int x, int y, float centre_m) const {
  constexpr double kSteepest = 4, kDeviations = 5;  // slope of a surface; of noise
  const double most =
      kSteepest * centre_m / K_.fx + kDeviations * depth_.noise.deviation_m(centre_m);
  for (int v = std::max(0, y - 1); v <= std::min(depth_.camera.height - 1, y + 1); ++v) {
    for (int u = std::max(0, x - 1); u <= std::min(depth_.camera.width - 1, x + 1); ++u) {
      const float beside_m = depth_.at(u, v);
      if (beside_m > 0 && std::abs(beside_m - centre_m) > most) return true;
    }
  }
  return false;
}

void DepthFitter::comparePlace(const PointTransform<double>& in_depth, std::size_t i) {
  const SurfacePlace<double>& place = surface_.places[i];
  const Vec3<double> q = inCamera(in_depth, place.p);
  if (!(q.z > 0)) return;
  const Pixel<double> at = project(K_, q);
  if (!(at.u > -0.5 && at.v > -0.5 && at.u < depth_.camera.width - 0.5 &&
        at.v < depth_.camera.height - 0.5)) {
    return;
  }
  const int x = static_cast<int>(std::lround(at.u)), y = static_cast<int>(std::lround(at.v));
  const Vec3<double> ray = {(x - K_.cx) / K_.fx, (y - K_.cy) / K_.fy, 1};
  ComparedDepth compared;
  if (!planeDepth(place, q, in_depth.R, ray, &compared.plane)) return;
  ++facing_;
  const float measured_m = depth_.at(x, y);
  if (!(measured_m > 0)) return;
  compared.measured = measured_m / unit_m_;
  ratios_.push_back(compared.measured / compared.plane.depth);
  if (isAtEdge(x, y, measured_m)) return;
  const bool counts = depth_.format == DepthImage::Format::kUint16;
  const double noise_m =
      depth_.noise.deviation_m(compared.plane.depth * unit_m_, counts ? depth_.unit_m : 0);
  compared.deviation = std::hypot(noise_m / unit_m_, kSurfaceError * object_.diameter,
                                  kLateral_px * compared.plane.slope / K_.fx);
  compared.tile = surface_.tile[i];
  compared_.push_back(compared);
}

/// Places that the object hides from the depth camera; the same for poses nearby.
void DepthFitter::findHidden(const Pose& T_O_C) {
  const CameraPose<double> pose = plainPose(T_O_C * T_C_D_);
  const Vec3<double> centre = plainVector(object_.centre);
  is_hidden_.assign(surface_.places.size(), 0);
  const double depth = pointTransform(pose, centre).t.z;
  if (!(depth > 0)) return;
  const int spacing = std::max(
      1, static_cast<int>(std::ceil(surface_.shown_spacing * surface_.shown_px * K_.fx / depth)));
  const Pinhole<float> K = {static_cast<float>(K_.fx), static_cast<float>(K_.fy),
                            static_cast<float>(K_.cx), static_cast<float>(K_.cy)};
  SelfOcclusion occlusion;
  const std::vector<std::int32_t>& hidden =
      occlusion.hidden(*surface_.shown, singleTransform(pose, centre),
                       {K, depth_.camera.width, depth_.camera.height, spacing});
  // Both are in the order of the cells.
  std::size_t k = 0;
  for (std::size_t i = 0; i < surface_.cell.size(); ++i) {
    while (k < hidden.size() && hidden[k] < surface_.cell[i]) ++k;
    is_hidden_[i] = k < hidden.size() && hidden[k] == surface_.cell[i];
  }
}

void DepthFitter::compare(const Pose& T_O_C) {
  const CameraPose<double> pose = plainPose(T_O_C * T_C_D_);
  const PointTransform<double> in_depth = pointTransform(pose, plainVector(object_.centre));
  compared_.clear();
  ratios_.clear();
  facing_ = 0;
  for (std::size_t i = 0; i < surface_.places.size(); ++i) {
    if (!is_hidden_[i]) comparePlace(in_depth, i);
  }
}

DepthCounts DepthFitter::count(double bias) const {
  DepthCounts counts;
  counts.facing = facing_;
  counts.measured = static_cast<int>(compared_.size());
  for (const ComparedDepth& c : compared_) {
    const double residual = (c.plane.depth + bias - c.measured) / c.deviation;
    counts.agreeing += std::abs(residual) <= kAgreeing;
    counts.nearer += residual > kAgreeing;
    counts.farther += residual < -kAgreeing;
  }
  return counts;
}

// How much larger errors are than the noise model says; never smaller.
double DepthFitter::noiseScale(double bias) const {
  constexpr double kOutlier = 8, kOfMedian = 0.6745, kMax = 3;
  std::vector<double> errors;
  for (const ComparedDepth& c : compared_) {
    const double error = std::abs(c.plane.depth + bias - c.measured) / c.deviation;
    if (error < kOutlier) errors.push_back(error);
  }
  return std::clamp(medianOf(errors) / kOfMedian, 1.0, kMax);
}

/// What a place says, beside what it would if its error were its own.
double DepthFitter::independence() const {
  if (compared_.empty()) return 1;
  const double depth = compared_[compared_.size() / 2].plane.depth;
  const double apart_px = surface_.spacing * K_.fx / depth / depth_.noise.correlation_px;
  return std::min(1.0, apart_px * apart_px);
}

// @param scale of the robust loss [deviations].
DepthSystem DepthFitter::sum(double bias, double scale) const {
  DepthSystem system;
  std::vector<Vector7> of_tile(surface_.tiles, Vector7::Zero());
  std::vector<double> tile_weight(surface_.tiles, 0.0);
  const double noise = noiseScale(bias), share = independence();
  for (const ComparedDepth& c : compared_) {
    const double deviation = noise * c.deviation;
    const double residual = (c.plane.depth + bias - c.measured) / deviation;
    const RobustTerm<double> robust = gemanMcClure(residual * residual, scale);
    Vector7 jacobian;
    for (int k = 0; k < 6; ++k) jacobian[k] = c.plane.jacobian[k] / deviation;
    jacobian[6] = 1 / deviation;
    const double weight = share * robust.weight;
    system.information += weight * jacobian * jacobian.transpose();
    of_tile[c.tile] += weight * residual * jacobian;
    tile_weight[c.tile] += weight;
  }
  for (const Vector7& gradient : of_tile) {
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

/// A Gauss-Newton step from `fit`. @return whether it was worth taking.
bool DepthFitter::step(const DepthPrior& prior, const Matrix6& information, double scale,
                       DepthFit* fit) {
  constexpr double kShort = 1e-3;  // [prior deviations]
  compare(fit->T_O_C);
  DepthSystem system = sum(fit->bias, scale);
  const Vector6 away = cameraTwist(prior.T_O_C, fit->T_O_C, object_.centre);
  system.information.topLeftCorner<6, 6>() += information;
  system.information(6, 6) += 1 / prior.bias_variance;
  system.gradient.head<6>() += information * away;
  system.gradient[6] += (fit->bias - prior.bias) / prior.bias_variance;
  const Vector7 x = -system.information.ldlt().solve(system.gradient);
  if (!x.allFinite()) return false;
  const Vec3<double> v = {x[0], x[1], x[2]}, w = {x[3], x[4], x[5]};
  fit->T_O_C = poseOf(moveCamera(plainPose(fit->T_O_C), plainVector(object_.centre), v, w));
  fit->bias += x[6];
  const double length = x.head<6>().dot(information * x.head<6>());
  return length + x[6] * x[6] / prior.bias_variance > kShort * kShort;
}

void DepthFitter::conclude(const DepthPrior& prior, const Matrix6& information, DepthFit* fit) {
  compare(fit->T_O_C);
  fit->counts = count(fit->bias);
  const DepthSystem system = sum(fit->bias, kAgreeing);
  Matrix7 known = Matrix7::Zero();
  known.topLeftCorner<6, 6>() = information;
  known(6, 6) = 1 / prior.bias_variance;
  // The sandwich estimate, as of colours: the scatter of tiles has what the noise model leaves out,
  // but is itself uncertain where there are few.
  const Eigen::LDLT<Matrix7> bread(system.information + known);
  const double spare = 1 - 7 / std::max(14.0, system.tiles);  // each was made small by its own
  const Matrix7 meat = known + 0.5 * (system.information + system.scatter / (spare * spare));
  const Matrix7 half = bread.solve(meat);
  Matrix7 covariance = bread.solve(half.transpose());
  covariance = (0.5 * (covariance + covariance.transpose())).eval();
  fit->covariance = covariance.topLeftCorner<6, 6>();
  fit->bias_variance = covariance(6, 6);
  const Vector6 away = cameraTwist(prior.T_O_C, fit->T_O_C, object_.centre);
  const double off = fit->bias - prior.bias;
  fit->squared_distance = away.dot(information * away) + off * off / prior.bias_variance;
}

DepthFit DepthFitter::fit(const DepthPrior& prior) {
  DepthFit fit;
  fit.T_O_C = prior.T_O_C;
  fit.bias = prior.bias;
  fit.covariance = prior.covariance;
  fit.bias_variance = prior.bias_variance;
  findHidden(prior.T_O_C);
  compare(prior.T_O_C);
  fit.before = fit.counts = count(prior.bias);
  if (!ratios_.empty()) fit.median_ratio = medianOf(ratios_);
  if (compared_.empty()) return fit;
  const Matrix6 information = inverseOf(prior.covariance);
  const Eigen::Vector3d sight = (prior.T_O_C.t - object_.centre).normalized();
  const double along =
      std::sqrt(sight.dot(prior.covariance.topLeftCorner<3, 3>() * sight) + prior.bias_variance);
  // All that the prior leaves open counts at first.
  double scale = kAgreeing + 2 * along / compared_.front().deviation;
  for (int i = 0; i < kMaxSteps; ++i) {
    const bool goes_on = step(prior, information, scale, &fit);
    if (!goes_on && scale == kAgreeing) break;
    scale = scale < 1.2 * kAgreeing ? kAgreeing : 0.5 * (scale + kAgreeing);
  }
  conclude(prior, information, &fit);
  return fit;
}

}  // namespace

DepthFit fitDepth(const DepthSurface& surface, const DepthImage& depth, const DepthPrior& prior,
                  const FieldMetadata& object) {
  return DepthFitter(surface, depth, object).fit(prior);
}

}  // namespace nerf_pose_refiner
