// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/pose.h"

#include <Eigen/LU>
#include <Eigen/SVD>
#include <cmath>

#include "math/so3.h"

namespace nerf_pose_refiner {

Eigen::Matrix3d expSO3(const Eigen::Vector3d& w) {
  const Mat3<double> R = expSO3(Vec3<double>{w.x(), w.y(), w.z()});
  return Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>>(&R.m[0][0]);
}

Eigen::Vector3d logSO3(const Eigen::Matrix3d& R) {
  const Vec3<double> w = logSO3(Mat3<double>{
      {{R(0, 0), R(0, 1), R(0, 2)}, {R(1, 0), R(1, 1), R(1, 2)}, {R(2, 0), R(2, 1), R(2, 2)}}});
  return {w.x, w.y, w.z};
}

bool Pose::isRigid(double tolerance) const {
  if (!isFinite()) return false;
  const Eigen::Matrix3d error = R * R.transpose() - Eigen::Matrix3d::Identity();
  return error.norm() < tolerance && std::abs(R.determinant() - 1.0) < tolerance;
}

double rotationDistance(const Eigen::Matrix3d& R_a, const Eigen::Matrix3d& R_b) {
  return logSO3(Eigen::Matrix3d(R_a.transpose() * R_b)).norm();
}

Eigen::Matrix3d nearestRotation(const Eigen::Matrix3d& R) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(R, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const Eigen::Matrix3d U = svd.matrixU();
  const Eigen::Matrix3d V = svd.matrixV();
  // The sign keeps the result a rotation where the nearest orthogonal matrix is a reflection.
  const Eigen::Vector3d signs(1, 1, (U * V.transpose()).determinant() < 0 ? -1 : 1);
  return U * signs.asDiagonal() * V.transpose();
}

}  // namespace nerf_pose_refiner
