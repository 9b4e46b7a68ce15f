// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/large_planes.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <random>
#include <utility>

namespace nerf_pose_refiner {
namespace {

constexpr int kMaxPlanes = 3, kPoints = 3000, kRefinements = 3;
// Of a plane with a third of the points, one triple in 27 lies on it: all but 0.4 % are met.
constexpr int kTrials = 150;

using Points = std::vector<Eigen::Vector3d>;

/// About kPoints of those that are known, on a grid.
Points somePoints(const ImageOf<float>& metres, const Camera& camera) {
  const double pixels = static_cast<double>(metres.width) * metres.height;
  const int step = std::max(1, static_cast<int>(std::sqrt(pixels / kPoints)));
  Points points;
  for (int y = step / 2; y < metres.height; y += step) {
    for (int x = step / 2; x < metres.width; x += step) {
      const double z = metres.at(x, y, 0);
      if (z > 0 && std::isfinite(z)) points.push_back(z * camera.direction(x, y));
    }
  }
  return points;
}

Points onPlane(const Points& points, const Plane& plane, const PlaneSearch& search) {
  Points on;
  for (const Eigen::Vector3d& p : points) {
    if (search.isOn(plane, p)) on.push_back(p);
  }
  return on;
}

/// The plane that fits points best, and how wide it is where it is narrowest [m].
struct FittedPlane {
  Plane plane;
  double width_m;
};

FittedPlane fitted(const Points& points) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& p : points) middle += p;
  middle /= static_cast<double>(points.size());
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& p : points) moments += (p - middle) * (p - middle).transpose();
  moments /= static_cast<double>(points.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(moments);
  const double narrow = std::max(0.0, eigen.eigenvalues()[1]);
  constexpr double kEvenly = 12;  // squared width by variance, of points that are spread evenly
  return {Plane(Eigen::Vector3d(eigen.eigenvectors().col(0)), middle), std::sqrt(kEvenly * narrow)};
}

/// The plane that most points lie on.
std::optional<Plane> mostCommon(const Points& points, const PlaneSearch& search,
                                std::mt19937* random) {
  if (points.size() < 3) return std::nullopt;
  std::uniform_int_distribution<std::size_t> any(0, points.size() - 1);
  std::optional<Plane> best;
  std::ptrdiff_t most = 0;
  for (int i = 0; i < kTrials; ++i) {
    const Eigen::Vector3d &a = points[any(*random)], &b = points[any(*random)],
                          &c = points[any(*random)];
    const Plane plane = Plane::Through(a, b, c);
    if (!plane.coeffs().allFinite()) continue;
    const auto count = std::count_if(points.begin(), points.end(), [&](const Eigen::Vector3d& p) {
      return search.isOn(plane, p);
    });
    if (count <= most) continue;
    most = count;
    best = plane;
  }
  return best;
}

}  // namespace

std::vector<Plane> largePlanes(const ImageOf<float>& metres, const Camera& camera,
                               const PlaneSearch& search) {
  Points points = somePoints(metres, camera);
  const double least = std::max(3.0, search.least_fraction * static_cast<double>(points.size()));
  std::mt19937 random(1);
  std::vector<Plane> planes;
  for (int i = 0; i < kMaxPlanes; ++i) {
    const std::optional<Plane> found = mostCommon(points, search, &random);
    if (!found) break;
    FittedPlane fit = {*found, 0};
    Points on = onPlane(points, fit.plane, search);
    for (int k = 0; k < kRefinements && on.size() >= 3; ++k) {
      fit = fitted(on);
      on = onPlane(points, fit.plane, search);
    }
    if (static_cast<double>(on.size()) < least) break;
    if (fit.width_m >= search.least_width_m) planes.push_back(fit.plane);
    points.erase(
        std::remove_if(points.begin(), points.end(),
                       [&](const Eigen::Vector3d& p) { return search.isOn(fit.plane, p); }),
        points.end());
  }
  return planes;
}

}  // namespace nerf_pose_refiner
