// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/symmetry.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "geometry/line_of_sight.h"

namespace nerf_pose_refiner {
namespace {

// What people type is rounded: motions that differ by less are the same.
constexpr double kSameAngle_rad = 0.01;
constexpr double kSameLength = 0.01;  // fraction of the lengths that were given

void require(bool holds, const char* what) {
  if (!holds) throw std::invalid_argument(what);
}

/// Tells motions apart.
struct Comparison {
  std::optional<SymmetryAxis> axis;
  double same_length;

  double offAxis(const Eigen::Vector3d& p) const {
    return (p - axis->point).cross(axis->direction).norm();
  }

  void requireKeepsAxis(const Pose& motion) const {
    const double angle = angleBetween(motion.R * axis->direction, axis->direction);
    require(std::min(angle, M_PI - angle) < kSameAngle_rad &&
                offAxis(motion * axis->point) < same_length,
            "a discrete symmetry does not map the continuous axis onto itself");
  }

  /// Whether two motions are one, but for a turn about the axis.
  bool same(const Pose& a, const Pose& b) const {
    const Pose between = a.inverse() * b;
    const bool turned =
        axis ? angleBetween(between.R * axis->direction, axis->direction) >= kSameAngle_rad
             : rotationDistance(between.R, Eigen::Matrix3d::Identity()) >= kSameAngle_rad;
    if (turned) return false;
    const Eigen::Vector3d point = axis ? axis->point : Eigen::Vector3d::Zero();
    require((between * point - point).norm() < same_length,
            "together the symmetries shift the object: their axes do not meet in one point");
    return true;
  }
};

}  // namespace

Pose turnAbout(const SymmetryAxis& axis, double angle_rad) {
  const Eigen::Matrix3d R = expSO3(angle_rad * axis.direction.normalized());
  return {R, axis.point - R * axis.point};
}

Symmetries::Symmetries(const std::optional<SymmetryAxis>& axis, const std::vector<Pose>& given)
    : axis_(axis) {
  double longest = 0;
  if (axis_) {
    require(axis_->direction.allFinite() && axis_->direction.norm() > 0 && axis_->point.allFinite(),
            "the axis of a symmetry has no direction");
    axis_->direction.normalize();
    longest = axis_->point.norm();
  }
  for (const Pose& motion : given) {
    require(motion.isRigid(), "a symmetry is not a rigid motion");
    longest = std::max(longest, motion.t.norm());
  }
  const Comparison compare = {axis_, kSameLength * longest + 1e-9};
  if (axis_) {
    for (const Pose& motion : given) compare.requireKeepsAxis(motion);
  }
  // Each new product is multiplied by all that are given, until nothing new comes of it.
  for (std::size_t i = 0; i < motions_.size(); ++i) {
    for (const Pose& motion : given) {
      const Pose product = motions_[i] * motion;
      const bool known = std::any_of(motions_.begin(), motions_.end(), [&](const Pose& other) {
        return compare.same(product, other);
      });
      if (!known) motions_.push_back({nearestRotation(product.R), product.t});
      require(motions_.size() <= kMaxMotions,
              "the products of the symmetries are infinitely many: no solid object has them");
    }
  }
}

Pose Symmetries::nearest(const Eigen::Matrix3d& R_C_O,
                         const Eigen::Matrix3d& reference_R_C_O) const {
  Pose nearest;
  double nearest_trace = -2;  // 1 + 2 cos(angle) is not less than -1
  for (const Pose& motion : motions_) {
    Eigen::Matrix3d left = reference_R_C_O.transpose() * R_C_O * motion.R;
    Pose candidate = motion;
    if (axis_) {
      // trace(left * turn) = c + a cos(angle) + b sin(angle), by Rodrigues.
      const Eigen::Vector3d& u = axis_->direction;
      const Eigen::Vector3d twice_skew(left(1, 2) - left(2, 1), left(2, 0) - left(0, 2),
                                       left(0, 1) - left(1, 0));
      const Pose turn =
          turnAbout(*axis_, std::atan2(twice_skew.dot(u), left.trace() - u.dot(left * u)));
      left = left * turn.R;
      candidate = motion * turn;
    }
    if (left.trace() <= nearest_trace + 1e-9) continue;  // of equals the first
    nearest_trace = left.trace();
    nearest = candidate;
  }
  return nearest;
}

Symmetries Symmetries::inFrame(const Pose& T_N_O) const {
  Symmetries moved = *this;
  if (axis_) moved.axis_ = SymmetryAxis{T_N_O.R * axis_->direction, T_N_O * axis_->point};
  for (Pose& motion : moved.motions_) motion = T_N_O * motion * T_N_O.inverse();
  return moved;
}

Symmetries Symmetries::scaled(double length_per_unit) const {
  Symmetries scaled = *this;
  if (axis_) scaled.axis_->point *= length_per_unit;
  for (Pose& motion : scaled.motions_) motion.t *= length_per_unit;
  return scaled;
}

std::string describe(const Symmetries& symmetries) {
  const std::size_t motions = symmetries.motions().size() - 1;
  std::string text = symmetries.axis() ? "any turn about an axis" : "";
  if (motions == 0) return text;
  if (!text.empty()) text += ", and ";
  return text + std::to_string(motions) + (motions == 1 ? " motion" : " motions");
}

Pose nearestEquivalent(const Pose& T_O_C, const Pose& reference_T_O_C,
                       const Symmetries& symmetries) {
  if (!symmetries.any()) return T_O_C;
  const Pose motion = symmetries.nearest(T_O_C.R.transpose(), reference_T_O_C.R.transpose());
  return motion.inverse() * T_O_C;
}

}  // namespace nerf_pose_refiner
