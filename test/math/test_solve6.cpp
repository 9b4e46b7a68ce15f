// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/solve6.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <limits>
#include <random>

namespace nerf_pose_refiner {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Adds a residual with its row of the Jacobian.
void addResidual(const double row[6], double residual, double weight,
                 NormalEquations6<double>* equations) {
  double* entry = equations->information;
  for (int i = 0; i < 6; ++i) {
    for (int j = 0; j <= i; ++j) *entry++ += weight * row[i] * row[j];
    equations->gradient[i] += weight * row[i] * residual;
  }
}

struct Problem {
  NormalEquations6<double> equations;
  Matrix6 A = Matrix6::Zero();
  Vector6 g = Vector6::Zero();
};

/// Random residuals; unknown i is in units that are `unit[i]` times larger.
Problem randomProblem(unsigned seed, const Vector6& unit) {
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  Problem problem;
  for (int n = 0; n < 20; ++n) {
    Vector6 row;
    for (int i = 0; i < 6; ++i) row[i] = normal(random) * unit[i];
    const double residual = normal(random);
    const double weight = std::abs(normal(random));
    addResidual(row.data(), residual, weight, &problem.equations);
    problem.A += weight * row * row.transpose();
    problem.g += weight * residual * row;
  }
  return problem;
}

TEST(Solve6, AgreesWithEigen) {
  Vector6 unit;
  unit << 1, 10, 1e-3, 1e4, 2, 0.5;
  for (unsigned seed = 0; seed < 20; ++seed) {
    for (const double damping : {0.0, 1e-3, 1.0}) {
      const Problem problem = randomProblem(seed, unit);
      Matrix6 damped = problem.A;
      damped.diagonal() *= 1 + damping;
      const Vector6 expected = damped.ldlt().solve(-problem.g);
      Vector6 x;
      ASSERT_TRUE(solve6(problem.equations, damping, 1e-9, x.data()));
      for (int i = 0; i < 6; ++i) EXPECT_NEAR(x[i] * unit[i], expected[i] * unit[i], 1e-9);
    }
  }
}

TEST(Solve6, DiagonalByHand) {
  NormalEquations6<float> equations;
  for (int i = 0; i < 6; ++i) {
    equations.information[i * (i + 3) / 2] = static_cast<float>(i + 1);
    equations.gradient[i] = 2;
  }
  float x[6];
  ASSERT_TRUE(solve6(equations, 1.f, 1e-6f, x));
  for (int i = 0; i < 6; ++i) EXPECT_FLOAT_EQ(x[i], -1.f / static_cast<float>(i + 1));
  EXPECT_FLOAT_EQ(factorise6(equations.information, 0.f).smallest_pivot, 1);
}

TEST(Solve6, PivotOfACorrelatedPairByHand) {
  // Unknowns 0 and 1 with correlation 0.8: the second pivot is 1 - 0.64.
  NormalEquations6<double> equations;
  for (int i = 0; i < 6; ++i) equations.information[i * (i + 3) / 2] = 4;
  equations.information[1] = 3.2;
  EXPECT_NEAR(factorise6(equations.information, 0.0).smallest_pivot, 0.36, 1e-15);
}

TEST(Solve6, RefusesWhatCannotBeSolved) {
  double x[6] = {7, 7, 7, 7, 7, 7};
  NormalEquations6<double> nothing;
  EXPECT_FALSE(solve6(nothing, 1e-3, 1e-9, x));

  // Five residuals do not fix six unknowns.
  NormalEquations6<double> flat;
  std::mt19937 random(5);
  std::normal_distribution<double> normal;
  for (int n = 0; n < 5; ++n) {
    double row[6];
    for (double& value : row) value = normal(random);
    addResidual(row, 1.0, 1.0, &flat);
  }
  EXPECT_FALSE(solve6(flat, 0.0, 1e-9, x));
  EXPECT_LT(factorise6(flat.information, 0.0).smallest_pivot, 1e-9);

  Problem poisoned = randomProblem(1, Vector6::Ones());
  poisoned.equations.information[4] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(solve6(poisoned.equations, 1e-3, 1e-9, x));
  poisoned = randomProblem(1, Vector6::Ones());
  poisoned.equations.gradient[2] = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(solve6(poisoned.equations, 1e-3, 1e-9, x));
  for (const double value : x) EXPECT_EQ(value, 7);
}

TEST(Solve6, DampingMakesASingularSystemSolvable) {
  NormalEquations6<double> equations;
  const double row[6] = {1, 1, 1, 1, 1, 1};
  addResidual(row, 6.0, 1.0, &equations);
  double x[6];
  EXPECT_FALSE(solve6(equations, 0.0, 1e-9, x));
  ASSERT_TRUE(solve6(equations, 0.5, 1e-9, x));
  for (const double value : x) EXPECT_NEAR(value, -6 / 6.5, 1e-12);
}

}  // namespace
}  // namespace nerf_pose_refiner
