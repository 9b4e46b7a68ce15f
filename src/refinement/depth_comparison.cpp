// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/depth_comparison.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "backend/common/plain_pose.h"
#include "backend/common/self_occlusion.h"
#include "math/keyframe_search.h"
#include "math/robust.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kSurfaceError = 0.004;  // deviation of the learned surface [diameters]
// What a pixel shows lies beside it by so much (Nguyen, Izadi, Lovell 2012), the more on windows
// that reach over edges.
constexpr double kLateral_px = 0.8;
constexpr double kEdgeAgrees_px = 2;

}  // namespace

double fractionOf(int part, int whole) {
  return whole > 0 ? static_cast<double>(part) / static_cast<double>(whole) : 0;
}

DepthReport reportOf(const DepthCounts& counts) {
  DepthReport report;
  report.measured = fractionOf(counts.measured, counts.facing);
  report.agreeing = fractionOf(counts.agreeing, counts.measured);
  report.nearer = fractionOf(counts.nearer, counts.measured);
  report.farther = fractionOf(counts.farther, counts.measured);
  return report;
}

double shownFraction(const DepthCounts& counts) {
  return fractionOf(counts.agreeing, counts.measured);
}

DepthComparison::DepthComparison(const DepthSurface& surface, const DepthImage& depth,
                                 const FieldMetadata& object)
    : surface_(surface),
      depth_(depth),
      object_(object),
      unit_m_(object.metres_per_unit),
      T_C_D_(depth.T_C_D.R, depth.T_C_D.t / unit_m_),
      K_{depth.camera.fx, depth.camera.fy, depth.camera.cx, depth.camera.cy} {}

// Pixels between two surfaces show neither.
bool DepthComparison::isAtEdge(int x, int y, float centre_m) const {
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

void DepthComparison::comparePlace(const PointTransform<double>& in_depth, std::size_t i) {
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
  compared.x = x;
  compared.y = y;
  places_.push_back(compared);
}

void DepthComparison::compareEdge(const PointTransform<double>& in_depth, double bias,
                                  std::size_t i) {
  // What stands behind the object is farther by so much at least; the object itself is nowhere
  // nearer by more than its size [diameters].
  constexpr double kDrop = 0.04, kNearest = 0.7;
  const OutlineEdge& edge = surface_.outline[i];
  const Vec3<double> q = inCamera(in_depth, edge.p),
                     beside = inCamera(in_depth, edge.p + edge.normal);
  if (!(q.z > 0 && beside.z > 0)) return;
  EdgeProfile profile;
  profile.middle = project(K_, q);
  const Pixel<double> end = project(K_, beside);
  const double u = end.u - profile.middle.u, v = end.v - profile.middle.v,
               length = std::hypot(u, v);
  if (!(length > 1e-9)) return;
  profile.outside = {u / length, v / length};
  const double expected = q.z + bias;
  const double noise = depth_.noise.deviation_m(expected * unit_m_) / unit_m_;
  profile.nearest_m = unit_m_ * (expected - kNearest * object_.diameter);
  profile.farthest_m = unit_m_ * (expected + kDrop * object_.diameter + kDepthAgrees * noise);
  ComparedEdge compared;
  compared.edge = findDepthEdge(depth_, profile);
  if (compared.edge.kind == DepthEdge::Kind::kUnknown) return;
  const PixelFlow<double> flow = pointFlow(K_, in_depth, edge.p, q);
  // A point's own pixel moves against the flow past it.
  for (int k = 0; k < 6; ++k) {
    compared.jacobian[k] = -(profile.outside.u * flow.u[k] + profile.outside.v * flow.v[k]);
  }
  compared.tile = surface_.outline_tile[i];
  edges_.push_back(compared);
}

void DepthComparison::findHidden(const Pose& T_O_C) {
  const CameraPose<double> pose = plainPose(T_O_C * T_C_D_);
  const Vec3<double> centre = plainVector(object_.centre);
  is_hidden_.assign(surface_.places.size(), 0);
  if (surface_.shown == nullptr) return;  // too little of the surface is known
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

void DepthComparison::compare(const Pose& T_O_C, double bias, bool outline) {
  const CameraPose<double> pose = plainPose(T_O_C * T_C_D_);
  const PointTransform<double> in_depth = pointTransform(pose, plainVector(object_.centre));
  distance_ = in_depth.t.z;
  places_.clear();
  edges_.clear();
  ratios_.clear();
  facing_ = 0;
  for (std::size_t i = 0; i < surface_.places.size(); ++i) {
    if (!is_hidden_[i]) comparePlace(in_depth, i);
  }
  if (!outline) return;
  for (std::size_t i = 0; i < surface_.outline.size(); ++i) compareEdge(in_depth, bias, i);
}

DepthCounts DepthComparison::count(double bias) const {
  DepthCounts counts;
  counts.facing = facing_;
  counts.measured = static_cast<int>(places_.size());
  for (const ComparedDepth& c : places_) {
    const double residual = (c.plane.depth + bias - c.measured) / c.deviation;
    counts.agreeing += std::abs(residual) <= kDepthAgrees;
    counts.nearer += residual > kDepthAgrees;
    counts.farther += residual < -kDepthAgrees;
  }
  counts.edges = static_cast<int>(edges_.size());
  for (const ComparedEdge& c : edges_) {
    counts.agreeing_edges +=
        c.edge.kind == DepthEdge::Kind::kFound && std::abs(c.edge.offset_px) <= kEdgeAgrees_px;
  }
  return counts;
}

double DepthComparison::smoothAgreement() const {
  constexpr int kSteps = 8;
  constexpr double kFirstScale = 20;
  using Vector = Eigen::Matrix<double, 6, 1>;
  using Matrix = Eigen::Matrix<double, 6, 6>;
  if (places_.size() < 12) return 1;
  double u0 = 0, v0 = 0, size = 1;
  for (const ComparedDepth& c : places_) {
    u0 += c.x / static_cast<double>(places_.size());
    v0 += c.y / static_cast<double>(places_.size());
  }
  for (const ComparedDepth& c : places_) {
    size = std::max({size, std::abs(c.x - u0), std::abs(c.y - v0)});
  }
  const auto terms = [&](const ComparedDepth& c) {
    const double u = (c.x - u0) / size, v = (c.y - v0) / size;
    return (Vector() << 1, u, v, u * u, u * v, v * v).finished();
  };
  Vector shape = Vector::Zero();
  double scale = 0;  // none
  for (int k = 0; k < kSteps; ++k) {
    Matrix information = 1e-9 * Matrix::Identity();
    Vector sum = Vector::Zero();
    for (const ComparedDepth& c : places_) {
      const Vector t = terms(c);
      const double r = (t.dot(shape) - c.measured) / c.deviation;
      const double w =
          (scale > 0 ? gemanMcClure(r * r, scale).weight : 1) / (c.deviation * c.deviation);
      information += w * t * t.transpose();
      sum += w * c.measured * t;
    }
    shape = information.ldlt().solve(sum);
    scale = scale > 0 ? std::max(kDepthAgrees, 0.6 * scale) : kFirstScale;
  }
  int agreeing = 0;
  for (const ComparedDepth& c : places_) {
    agreeing += std::abs(terms(c).dot(shape) - c.measured) <= kDepthAgrees * c.deviation;
  }
  return fractionOf(agreeing, static_cast<int>(places_.size()));
}

double DepthComparison::spacing_px() const {
  const double depth = places_.empty() ? distance_ : places_[places_.size() / 2].plane.depth;
  return surface_.spacing * K_.fx / depth;
}

double DepthComparison::outlineSpacing_px() const {
  if (surface_.outline.empty()) return 0;
  const double around = M_PI * object_.diameter * K_.fx / std::max(distance_, 1e-9);
  return around / static_cast<double>(surface_.outline.size());
}

}  // namespace nerf_pose_refiner
