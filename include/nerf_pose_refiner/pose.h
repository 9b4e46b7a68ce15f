// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace nerf_pose_refiner {

/// Rotation exp([w]_x) about `w` by |w| radians (Rodrigues).
Eigen::Matrix3d expSO3(const Eigen::Vector3d& w);

/// Rotation vector of R, |w| in [0, pi]; the inverse of expSO3, also near 0 and near pi.
Eigen::Vector3d logSO3(const Eigen::Matrix3d& R);

/// A rigid transform `T_A_B`: takes a point from frame B to frame A, x_A = R x_B + t.
///
/// Rotation and translation are kept apart, SO(3) x T(3) (Lin et al., section IV-A), because that
/// is how every solver of this package updates them.
struct Pose {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();

  Pose() = default;
  Pose(const Eigen::Matrix3d& rotation, const Eigen::Vector3d& translation)
      : R(rotation), t(translation) {}

  Pose inverse() const { return {R.transpose(), -(R.transpose() * t)}; }
  bool isFinite() const { return R.allFinite() && t.allFinite(); }

  /// True if R is a rotation: |R R^T - I| and |det R - 1| below `tolerance`.
  bool isRigid(double tolerance = 1e-3) const;
};

/// T_A_C = T_A_B * T_B_C.
inline Pose operator*(const Pose& T_A_B, const Pose& T_B_C) {
  return {T_A_B.R * T_B_C.R, T_A_B.R * T_B_C.t + T_A_B.t};
}

/// x_A = T_A_B * x_B.
inline Eigen::Vector3d operator*(const Pose& T_A_B, const Eigen::Vector3d& x_B) {
  return T_A_B.R * x_B + T_A_B.t;
}

/// Angle of the rotation between two orientations [rad], in [0, pi].
double rotationDistance(const Eigen::Matrix3d& R_a, const Eigen::Matrix3d& R_b);

/// The same orientation with R made orthonormal again (nearest rotation, by SVD).
Eigen::Matrix3d nearestRotation(const Eigen::Matrix3d& R);

/// Default half widths of the search around a rough pose: about each axis, and along each axis in
/// diameters of the object.
constexpr double kSearchRotation_deg = 15;
constexpr double kSearchRotation_rad = kSearchRotation_deg * 3.14159265358979323846 / 180;
constexpr double kSearchTranslation = 0.15;

}  // namespace nerf_pose_refiner
