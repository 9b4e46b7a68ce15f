// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "geometry/matrix6.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>

#include "geometry/line_of_sight.h"

namespace nerf_pose_refiner {
namespace {

/// Symmetric and positive definite: 2 on the diagonal, 1 beside it.
Matrix6 tridiagonal() {
  Matrix6 A = 2 * Matrix6::Identity();
  for (int i = 0; i < 5; ++i) A(i, i + 1) = A(i + 1, i) = 1;
  return A;
}

TEST(Matrix6, IsSolvedByHand) {
  const Vector6 ones = Vector6::Ones();
  Vector6 b;
  b << 3, 4, 4, 4, 4, 3;  // sums of rows
  EXPECT_TRUE(solved(tridiagonal(), b).isApprox(ones, 1e-12));
  EXPECT_TRUE(solved(tridiagonal(), tridiagonal()).isApprox(Matrix6::Identity(), 1e-12));
  // (A^-1)_ij = (-1)^(i+j) min(i, j) (7 - max(i, j)) / 7, counted from 1.
  const Matrix6 inverse = inverseOf(tridiagonal());
  EXPECT_NEAR(inverse(0, 0), 6.0 / 7, 1e-12);
  EXPECT_NEAR(inverse(1, 3), 2 * 3.0 / 7, 1e-12);
  EXPECT_NEAR(inverse(4, 1), -2 * 2.0 / 7, 1e-12);
}

TEST(Matrix6, DistancesAreInStandardDeviations) {
  Vector6 variances, v;
  variances << 1, 4, 9, 16, 25, 36;
  v << 1, 2, 0, 0, 5, 12;
  EXPECT_NEAR(squaredDistance(v, variances.asDiagonal()), 1 + 1 + 1 + 4, 1e-12);
}

TEST(Matrix6, CovariancesFollowTheirVectors) {
  Matrix6 J = Matrix6::Identity();
  J(0, 1) = 3;  // x0 + 3 x1
  Vector6 variances;
  variances << 1, 2, 1, 1, 1, 1;
  const Matrix6 covariance = transformed(J, variances.asDiagonal());
  EXPECT_EQ(covariance(0, 0), 1 + 9 * 2);
  EXPECT_EQ(covariance(0, 1), 3 * 2);
  EXPECT_EQ(covariance(1, 1), 2);
}

TEST(Matrix6, EigenvaluesAscend) {
  const Eigen6 eigen = eigenOf(tridiagonal());
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(eigen.values[i], 2 - 2 * std::cos((i + 1) * M_PI / 7), 1e-12);
    const Vector6 direction = eigen.vectors.col(i);
    EXPECT_TRUE((tridiagonal() * direction).isApprox(eigen.values[i] * direction, 1e-9));
  }
}

TEST(LineOfSight, AxesLookAlongIt) {
  for (const Eigen::Vector3d& along :
       {Eigen::Vector3d(0, 0, 2), Eigen::Vector3d(1, -2, 3), Eigen::Vector3d(0, 0, -1)}) {
    const Eigen::Matrix3d axes = lineOfSightAxes(along);
    EXPECT_TRUE(axes.col(2).isApprox(along.normalized(), 1e-12)) << along.transpose();
    EXPECT_NEAR(axes.determinant(), 1, 1e-12);
  }
  EXPECT_TRUE(lineOfSightAxes({0, 0, 2}).isIdentity(1e-12));
}

}  // namespace
}  // namespace nerf_pose_refiner
