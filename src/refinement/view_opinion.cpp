// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/view_opinion.h"

#include <cmath>

#include "geometry/matrix6.h"
#include "math/so3.h"
#include "refinement/covariance.h"

namespace nerf_pose_refiner {
namespace {

/// Of a symmetric positive semidefinite matrix.
Matrix6 rootOf(const Matrix6& matrix) {
  const Eigen6 eigen = eigenOf(matrix);
  return transformed(eigen.vectors, eigen.values.cwiseMax(0.0).cwiseSqrt().asDiagonal());
}

}  // namespace

ViewOpinion joined(const std::vector<ViewOpinion>& opinions) {
  if (opinions.size() == 1) return opinions.front();
  ViewOpinion all;
  Matrix6 information = Matrix6::Zero();
  Vector6 sum = Vector6::Zero();
  for (const ViewOpinion& one : opinions) {
    const Matrix6 of_one = inverseOf(one.noise + one.model);
    information += of_one;
    sum += of_one * one.twist;
  }
  const Matrix6 spread = inverseOf(information);
  all.twist = spread * sum;
  all.noise.setZero();
  Matrix6 root = Matrix6::Zero();
  for (const ViewOpinion& one : opinions) {
    const Matrix6 weight = spread * inverseOf(one.noise + one.model);
    all.noise += transformed(weight, one.noise);
    root += weight * rootOf(one.model);
  }
  all.model = root * root.transpose();
  return all;
}

double apart(const ViewOpinion& a, const ViewOpinion& b) {
  const Vector6 away = a.twist - b.twist;
  const Matrix6 covariance = a.noise + a.model + b.noise + b.model;
  return std::sqrt(squaredDistance(away, covariance));
}

Pose movedBy(const Vector6& twist, const Pose& T_O_C, const Eigen::Vector3d& centre) {
  const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(twist.tail<3>()));
  return {nearestRotation(turn * T_O_C.R), centre + twist.head<3>() + turn * (T_O_C.t - centre)};
}

Matrix6 placeCovariance(const Pose& T_O_V, double position_dev, double rotation_dev_rad,
                        const FieldMetadata& object) {
  const Eigen::Matrix3d lever = crossOf(object.centre - T_O_V.t);
  const double position = position_dev * position_dev, turn = rotation_dev_rad * rotation_dev_rad;
  Matrix6 covariance;
  covariance << position * Eigen::Matrix3d::Identity() - turn * lever * lever, turn * lever,
      -turn * lever, turn * Eigen::Matrix3d::Identity();
  return covariance;
}

}  // namespace nerf_pose_refiner
