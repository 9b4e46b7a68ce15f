// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>

namespace nerf_pose_refiner {

// Twists and their covariances. Eigen's decompositions of this size are compiled here alone: they
// take a compiler seconds in each file that uses them.

using Vector6 = Eigen::Matrix<double, 6, 1>;
using Matrix6 = Eigen::Matrix<double, 6, 6>;

/// The solution x of A x = b by Cholesky decomposition (LDL^T). @param A symmetric, semidefinite.
Vector6 solved(const Matrix6& A, const Vector6& b);
Matrix6 solved(const Matrix6& A, const Matrix6& b);

/// The inverse of a symmetric, positive definite matrix.
Matrix6 inverseOf(const Matrix6& A);

/// The covariance of J x, that of x being `covariance`.
Matrix6 transformed(const Matrix6& J, const Matrix6& covariance);

/// How unlikely a vector is of a normal distribution with mean 0: v^T covariance^-1 v, the square
/// of Mahalanobis's distance.
double squaredDistance(const Vector6& v, const Matrix6& covariance);

/// Eigenvalues in ascending order, and eigenvectors in columns, of a symmetric matrix.
struct Eigen6 {
  Vector6 values;
  Matrix6 vectors;
};
Eigen6 eigenOf(const Matrix6& symmetric);

}  // namespace nerf_pose_refiner
