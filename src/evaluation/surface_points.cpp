// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <set>
#include <stdexcept>

#include "backend/loaded_field.h"
#include "evaluation/model_points.h"
#include "field/field.h"
#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kViews = 32;
constexpr int kSide_px = 64;         // of an image
constexpr double kDistance = 3;      // of the cameras from the centre [diameters]
constexpr double kCellsAcross = 72;  // of the grid that thins the points, along the diameter
constexpr float kOpaque = 0.9f;      // at a rim the expected point hangs between two surfaces
constexpr double kGoldenAngle = 2.399963229728653;

/// A camera at the i-th of n directions spread evenly over the sphere (a Fibonacci lattice),
/// looking at the centre.
Pose cameraAround(const Eigen::Vector3d& centre, double distance, int i, int n) {
  const double z = 1 - (2.0 * i + 1) / n;
  const double r = std::sqrt(1 - z * z);
  const Eigen::Vector3d outwards(r * std::cos(kGoldenAngle * i), r * std::sin(kGoldenAngle * i), z);
  Pose T_O_C;
  T_O_C.R.col(2) = -outwards;
  T_O_C.R.col(0) = T_O_C.R.col(2).unitOrthogonal();
  T_O_C.R.col(1) = T_O_C.R.col(2).cross(T_O_C.R.col(0));
  T_O_C.t = centre + distance * outwards;
  return T_O_C;
}

/// All that is seen, one view after the other.
std::vector<Eigen::Vector3d> visiblePoints(const LoadedField& field,
                                           const CancellationToken& cancellation) {
  const FieldMetadata& object = field.field().metadata;
  // The image just holds a ball of the object's diameter around its centre, and half as much
  // again: the centre of the object need not be in the middle.
  const double focal_px = 0.5 * kSide_px * std::sqrt(kDistance * kDistance - 0.5625) / 0.75;
  const double middle_px = 0.5 * (kSide_px - 1);
  const Camera camera = {kSide_px, kSide_px, focal_px, focal_px, middle_px, middle_px};
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < kViews; ++i) {
    const Pose T_O_C = cameraAround(object.centre, kDistance * object.diameter, i, kViews);
    const Rendering seen = field.render({camera, T_O_C}, RenderOptions(), cancellation);
    for (std::size_t p = 0; p < seen.alpha.pixels(); ++p) {
      const float alpha = seen.alpha.values[p];
      if (alpha < kOpaque) continue;
      const Eigen::Map<const Eigen::Vector3f> sum(&seen.point.values[3 * p]);
      points.push_back(sum.cast<double>() / alpha);
    }
  }
  return points;
}

/// Fisher and Yates.
void shuffle(std::vector<Eigen::Vector3d>* points, std::uint64_t seed) {
  const auto n = static_cast<std::uint32_t>(points->size());
  for (std::uint32_t i = 0; i < n; ++i) {
    std::swap((*points)[i], (*points)[i + randomIndex(seed, 0, i, n - i)]);
  }
}

}  // namespace

std::vector<Eigen::Vector3d> surfacePoints(const LoadedField& field, int count, std::uint64_t seed,
                                           const CancellationToken& cancellation) {
  if (count < 1) throw std::invalid_argument("surfacePoints: count is below 1");
  const FieldMetadata& object = field.field().metadata;
  if (!(object.diameter > 0)) {
    throw std::runtime_error("the diameter of the object '" + object.name + "' is not known");
  }
  std::vector<Eigen::Vector3d> points = visiblePoints(field, cancellation);
  if (points.empty()) throw std::runtime_error("nothing of '" + object.name + "' is opaque");
  shuffle(&points, seed);
  // Near parts of the surface are seen by many pixels: thinned, all of it counts alike.
  const double cell = object.diameter / kCellsAcross;
  std::set<std::array<long, 3>> taken;
  std::vector<Eigen::Vector3d> result;
  for (const Eigen::Vector3d& point : points) {
    const Eigen::Vector3d at = (point - object.centre) / cell;
    if (!taken.insert({std::lround(at.x()), std::lround(at.y()), std::lround(at.z())}).second) {
      continue;
    }
    result.push_back(point);
    if (static_cast<int>(result.size()) == count) break;
  }
  return result;
}

}  // namespace nerf_pose_refiner
