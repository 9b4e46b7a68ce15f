// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/planar_descent.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

namespace nerf_pose_refiner {
namespace {

constexpr double kTolerance = 1e-6;
constexpr int kMaxSteps = 1000;

/// Greatest distance of the path from the straight line between start and target.
double distanceFromLine(const std::vector<PlanarPose>& path, const PlanarPose& target) {
  const double dx = target.x - path[0].x;
  const double dy = target.y - path[0].y;
  double greatest = 0;
  for (const PlanarPose& p : path) {
    const double area = dx * (p.y - path[0].y) - dy * (p.x - path[0].x);
    greatest = std::max(greatest, std::abs(area) / std::hypot(dx, dy));
  }
  return greatest;
}

template <typename Update, typename Optimiser>
std::vector<PlanarPose> optimise(const PlanarPose& target, const Optimiser& optimiser) {
  std::vector<PlanarPose> path;
  optimiseInPlane<Update>(PlanarPose(), target, optimiser, {kTolerance, kMaxSteps},
                          [&](const PlanarPose& pose) { path.push_back(pose); });
  EXPECT_LT(planarError(path.back(), target), kTolerance);
  return path;
}

// (1, 2, 90 deg) against the identity: the elements differ by 1, 1, 1, 1 (rotation), 1 and 2.
TEST(PlanarDescent, errorIsTheMeanOverNineElements) {
  EXPECT_NEAR(planarError({1, 2, M_PI / 2}, {0, 0, 0}), (4 * 1 + 1 + 4) / 9.0, 1e-15);
  EXPECT_EQ(planarError({1, 2, 3}, {1, 2, 3}), 0);
}

// A quarter turn while moving by a quarter circle of radius 2 ends at (2, 2).
TEST(PlanarDescent, updatesOfSe2AreArcs) {
  const PlanarPose end = CoupledUpdate::apply({0, 0, 0}, {M_PI, 0, M_PI / 2});
  EXPECT_NEAR(end.x, 2, 1e-12);
  EXPECT_NEAR(end.y, 2, 1e-12);
  EXPECT_NEAR(end.angle, M_PI / 2, 1e-15);
  const PlanarPose turned_start = CoupledUpdate::apply({5, 0, M_PI / 2}, {3, 0, 0});
  EXPECT_NEAR(turned_start.x, 5, 1e-12);
  EXPECT_NEAR(turned_start.y, 3, 1e-12);
}

template <typename Update>
void expectGradientOfError() {
  const PlanarPose pose = {0.3, -0.7, 0.4};
  const PlanarPose target = {1.1, 0.2, 1.9};
  const double h = 1e-6;
  const PlanarVector axes[3] = {{h, 0, 0}, {0, h, 0}, {0, 0, h}};
  const PlanarVector gradient = Update::gradient(pose, target);
  const double expected[3] = {gradient.x, gradient.y, gradient.angle};
  for (int i = 0; i < 3; ++i) {
    const PlanarVector back = {-axes[i].x, -axes[i].y, -axes[i].angle};
    const double difference = planarError(Update::apply(pose, axes[i]), target) -
                              planarError(Update::apply(pose, back), target);
    EXPECT_NEAR(difference / (2 * h), expected[i], 1e-9);
  }
}

TEST(PlanarDescent, gradientsAreThoseOfTheirOwnUpdates) {
  expectGradientOfError<SeparateUpdate>();
  expectGradientOfError<CoupledUpdate>();
}

// Lin et al., Fig. 2. (Fewer steps are the rule, not a law: other rates can be found where the
// oscillation happens to end a few steps sooner in SE(2).)
TEST(PlanarDescent, separateMomentumStaysOnTheLineAndNeedsFewerSteps) {
  for (const double angle : {1.0, 1.5, 2.0, 2.5}) {
    const PlanarPose target = {3, 1, angle};
    const auto separate = optimise<SeparateUpdate>(target, PlanarHeavyBall());
    const auto coupled = optimise<CoupledUpdate>(target, PlanarHeavyBall());
    EXPECT_LT(distanceFromLine(separate, target), 1e-6);
    EXPECT_GT(distanceFromLine(coupled, target), 0.1);
    EXPECT_LT(separate.size(), coupled.size());
  }
}

// Second moments are taken element by element, so Adam's first step has the same length along x
// and y, whatever the gradient: its path cannot follow the line.
TEST(PlanarDescent, adamLeavesTheLine) {
  const PlanarPose target = {3, 1, 1.5};
  const PlanarAdam adam;
  const auto path = optimise<SeparateUpdate>(target, adam);
  EXPECT_NEAR(path[1].x, adam.rate, 1e-6);
  EXPECT_NEAR(path[1].y, adam.rate, 1e-6);
  EXPECT_GT(distanceFromLine(path, target), 0.1);
}

}  // namespace
}  // namespace nerf_pose_refiner
