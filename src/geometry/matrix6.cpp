// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "geometry/matrix6.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>

namespace nerf_pose_refiner {

Vector6 solved(const Matrix6& A, const Vector6& b) { return A.ldlt().solve(b); }

Matrix6 solved(const Matrix6& A, const Matrix6& b) { return A.ldlt().solve(b); }

Matrix6 inverseOf(const Matrix6& A) { return solved(A, Matrix6(Matrix6::Identity())); }

Matrix6 transformed(const Matrix6& J, const Matrix6& covariance) {
  return J * covariance * J.transpose();
}

double squaredDistance(const Vector6& v, const Matrix6& covariance) {
  return v.dot(solved(covariance, v));
}

Eigen6 eigenOf(const Matrix6& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Matrix6> eigen(symmetric);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

}  // namespace nerf_pose_refiner
