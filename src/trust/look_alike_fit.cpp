// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/look_alike_fit.h"

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <set>
#include <utility>

#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kSameAxis_rad = 8 * kDegree;
constexpr double kSameMotion_rad = 15 * kDegree;
constexpr double kSameOffset = 0.1;  // [diameters]

/// A turn by 0 to 180 degrees.
struct Turn {
  Eigen::Vector3d axis;
  double angle_rad;
};

Turn turnOf(const Pose& motion) {
  const Eigen::Vector3d w = logSO3(motion.R);
  const double angle = w.norm();
  return {angle > 0 ? Eigen::Vector3d(w / angle) : Eigen::Vector3d::UnitZ(), angle};
}

bool isAbout(const Confusion& confusion, const Eigen::Vector3d& axis) {
  return std::abs(turnOf(confusion.motion).axis.dot(axis)) > std::cos(kSameAxis_rad);
}

/// How many different angles, of 15 degrees each, the motions about an axis have.
int anglesAbout(const Eigen::Vector3d& axis, const std::vector<Confusion>& confusions) {
  std::set<int> angles;
  for (const Confusion& confusion : confusions) {
    if (!isAbout(confusion, axis)) continue;
    angles.insert(static_cast<int>(turnOf(confusion.motion).angle_rad / (15 * kDegree)));
  }
  return static_cast<int>(angles.size());
}

/// The axis that fits turns about nearly the same one best.
SymmetryAxis fittedAxis(const Eigen::Vector3d& near, const std::vector<Confusion>& confusions,
                        const Eigen::Vector3d& centre) {
  Eigen::Matrix3d outer = Eigen::Matrix3d::Zero();
  for (const Confusion& confusion : confusions) {
    if (!isAbout(confusion, near)) continue;
    const Eigen::Vector3d axis = turnOf(confusion.motion).axis;
    outer += axis * axis.transpose();
  }
  SymmetryAxis fitted;
  fitted.direction = Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(outer).eigenvectors().col(2);
  if (fitted.direction.dot(near) < 0) fitted.direction = -fitted.direction;
  // Points p of the axis stay where they are, (I - R) p = t; beside the centre, as little as that
  // takes.
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const Confusion& confusion : confusions) {
    if (!isAbout(confusion, near)) continue;
    const Eigen::Matrix3d stays = Eigen::Matrix3d::Identity() - confusion.motion.R;
    normal += stays.transpose() * stays;
    right += stays.transpose() * (confusion.motion * centre - centre);
  }
  normal += 1e-3 * normal.trace() * fitted.direction * fitted.direction.transpose();
  fitted.point = centre + normal.ldlt().solve(right);
  return fitted;
}

bool isSame(const Pose& a, const Pose& b, const FieldMetadata& object) {
  return rotationDistance(a.R, b.R) < kSameMotion_rad &&
         (a * object.centre - b * object.centre).norm() < kSameOffset * object.diameter;
}

/// Motions that images from several sides show, those that most show first.
std::vector<Pose> singleMotions(const std::vector<Confusion>& confusions,
                                const FieldMetadata& object) {
  constexpr std::size_t kMinViews = 2;
  std::vector<std::pair<std::size_t, Pose>> clusters;
  std::vector<char> is_taken(confusions.size(), 0);
  for (std::size_t i = 0; i < confusions.size(); ++i) {
    if (is_taken[i]) continue;
    std::set<int> views;
    for (std::size_t j = i; j < confusions.size(); ++j) {
      if (!isSame(confusions[i].motion, confusions[j].motion, object)) continue;
      is_taken[j] = 1;
      views.insert(confusions[j].view);
    }
    if (views.size() >= kMinViews) clusters.emplace_back(views.size(), confusions[i].motion);
  }
  std::stable_sort(clusters.begin(), clusters.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  if (clusters.size() > LookAlikes::kMaxMotions) clusters.resize(LookAlikes::kMaxMotions);
  std::vector<Pose> motions;
  for (const auto& cluster : clusters) motions.push_back(cluster.second);
  return motions;
}

}  // namespace

LookAlikes fitLookAlikes(const std::vector<Confusion>& confusions, const FieldMetadata& object) {
  constexpr int kMinAngles = 5;  // of twelve: a sixfold symmetry has three
  LookAlikes found;
  found.measured = true;
  int most = kMinAngles - 1;
  Eigen::Vector3d best = Eigen::Vector3d::Zero();
  for (const Confusion& confusion : confusions) {
    const Eigen::Vector3d axis = turnOf(confusion.motion).axis;
    const int angles = anglesAbout(axis, confusions);
    if (angles <= most) continue;
    most = angles;
    best = axis;
  }
  std::vector<Confusion> others = confusions;
  if (most >= kMinAngles) {
    found.axis = fittedAxis(best, confusions, object.centre);
    others.erase(
        std::remove_if(others.begin(), others.end(),
                       [&](const Confusion& c) { return isAbout(c, found.axis->direction); }),
        others.end());
  }
  found.motions = singleMotions(others, object);
  return found;
}

}  // namespace nerf_pose_refiner
