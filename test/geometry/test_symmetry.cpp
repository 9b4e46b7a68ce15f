// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/symmetry.h"

#include <gtest/gtest.h>

#include <limits>
#include <stdexcept>

#include "math/angle.h"
#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

const SymmetryAxis kZ;
const SymmetryAxis kX = {Eigen::Vector3d::UnitX(), Eigen::Vector3d::Zero()};

Pose nFold(const SymmetryAxis& axis, int n) { return turnAbout(axis, 2 * kPi / n); }

double distance(const Pose& a, const Pose& b) {
  return rotationDistance(a.R, b.R) + (a.t - b.t).norm();
}

TEST(Symmetry, TurnsAboutAnAxisThatMissesTheOrigin) {
  // A quarter turn about the vertical through (1, 0, 0) takes the origin to (1, -1, 0).
  const Pose turn = turnAbout({Eigen::Vector3d::UnitZ(), {1, 0, 7}}, kPi / 2);
  EXPECT_LT((turn * Eigen::Vector3d::Zero() - Eigen::Vector3d(1, -1, 0)).norm(), 1e-15);
  EXPECT_LT((turn * Eigen::Vector3d(1, 0, 3) - Eigen::Vector3d(1, 0, 3)).norm(), 1e-15);
}

TEST(Symmetry, NoneChangesNothing) {
  const Symmetries none;
  EXPECT_FALSE(none.any());
  const Pose pose(expSO3({0.3, 0.1, -2}), {1, 2, 3});
  const Pose same = nearestEquivalent(pose, Pose(), none);
  EXPECT_EQ(same.R, pose.R);
  EXPECT_EQ(same.t, pose.t);
}

TEST(Symmetry, FindsAllProducts) {
  EXPECT_EQ(Symmetries(std::nullopt, {nFold(kZ, 4)}).motions().size(), 4u);
  EXPECT_EQ(Symmetries(std::nullopt, {nFold(kZ, 2), nFold(kX, 2)}).motions().size(),
            4u);  // a brick
  EXPECT_EQ(Symmetries(std::nullopt, {nFold(kZ, 4), nFold(kX, 4)}).motions().size(), 24u);  // a die
  const SymmetryAxis diagonal = {Eigen::Vector3d(1, 1, 1).normalized(), Eigen::Vector3d::Zero()};
  EXPECT_EQ(Symmetries(std::nullopt, {nFold(kZ, 2), nFold(diagonal, 3)}).motions().size(), 12u);
  EXPECT_EQ(Symmetries(kZ, {}).motions().size(), 1u);
  EXPECT_EQ(Symmetries(kZ, {nFold(kX, 2)}).motions().size(), 2u) << "a plain cylinder";
  EXPECT_EQ(Symmetries(kZ, {nFold(kZ, 6), nFold(kX, 2)}).motions().size(), 2u);
  EXPECT_TRUE(Symmetries(kZ, {}).motions()[0].R.isIdentity());
}

TEST(Symmetry, RefusesWhatNoObjectHas) {
  const auto make = [](const std::optional<SymmetryAxis>& axis, const std::vector<Pose>& given) {
    return [=] { Symmetries(axis, given); };
  };
  expectError<std::invalid_argument>(make(std::nullopt, {Pose(Eigen::Matrix3d::Zero(), {0, 0, 0})}),
                                     "rigid");
  const Pose shift(Eigen::Matrix3d::Identity(), {0.1, 0, 0});
  expectError<std::invalid_argument>(make(std::nullopt, {shift}), "shift");
  expectError<std::invalid_argument>(make(std::nullopt, {turnAbout(kZ, 1)}), "infinitely many");
  const SymmetryAxis beside = {Eigen::Vector3d::UnitZ(), {0.3, 0, 0}};
  expectError<std::invalid_argument>(make(std::nullopt, {nFold(kZ, 2), nFold(beside, 2)}), "shift");
  expectError<std::invalid_argument>(make(kZ, {nFold(kX, 4)}), "axis onto itself");
  expectError<std::invalid_argument>(make(beside, {nFold(kZ, 2)}), "axis onto itself");
  expectError<std::invalid_argument>(make(SymmetryAxis{{0, 0, 0}, {0, 0, 0}}, {}), "no direction");
}

TEST(Symmetry, ABottleKeepsTheAngleOfTheReference) {
  // Tilted by 0.2 and spun by 2.5 rad; the reference is tilted otherwise and not spun.
  const Symmetries bottle(kZ, {});
  const Eigen::Matrix3d tilt = expSO3({0.2, 0, 0});
  const Eigen::Matrix3d reference = expSO3({0.2, 0.05, 0});
  const Pose S = bottle.nearest(tilt * expSO3({0, 0, 2.5}), reference);
  EXPECT_LT(rotationDistance(S.R, expSO3({0, 0, -2.5})), 0.02);
  EXPECT_NEAR(rotationDistance(tilt * expSO3({0, 0, 2.5}) * S.R, reference), 0.05, 1e-3);
  EXPECT_EQ(S.t.norm(), 0);
  // It is the best one: no turn of a fine grid comes nearer.
  for (int i = 0; i < 360; ++i) {
    const Eigen::Matrix3d turned = tilt * expSO3({0, 0, i * kPi / 180});
    EXPECT_GE(rotationDistance(turned, reference) + 1e-12,
              rotationDistance(tilt * expSO3({0, 0, 2.5}) * S.R, reference));
  }
}

TEST(Symmetry, APlainCylinderIsFlippedBackToo) {
  const Symmetries cylinder(kZ, {nFold(kX, 2)});
  const Eigen::Matrix3d reference = expSO3({0.1, 0.2, 0.3});
  // Upside down and spun by anything.
  for (const double spin : {0.0, 1.0, 2.0, 3.0, -2.0}) {
    const Eigen::Matrix3d seen = reference * expSO3({kPi, 0, 0}) * expSO3({0, 0, spin});
    const Pose S = cylinder.nearest(seen, reference);
    EXPECT_LT(rotationDistance(seen * S.R, reference), 1e-7) << spin;
  }
  EXPECT_GT(rotationDistance(
                expSO3({kPi, 0, 0}) * Symmetries(kZ, {}).nearest(expSO3({kPi, 0, 0}), reference).R,
                reference),
            2.5)
      << "a bottle is not";
}

TEST(Symmetry, TheOriginFollowsWhereTheAxisMissesIt) {
  // A two-fold axis along z through (1, 0, 0): the half turn takes O's origin to (2, 0, 0).
  const Symmetries box(std::nullopt, {nFold({Eigen::Vector3d::UnitZ(), {1, 0, 0}}, 2)});
  const Pose T_C_O(expSO3({0, 0, 3}), {0, 0, 5});
  const Pose nearest = nearestEquivalent(T_C_O.inverse(), Pose(), box).inverse();
  EXPECT_LT(rotationDistance(nearest.R, expSO3({0, 0, 3 - kPi})), 1e-12);
  const Eigen::Vector3d expected(2 * std::cos(3.0), 2 * std::sin(3.0), 5);
  EXPECT_LT((nearest.t - expected).norm(), 1e-12);
}

TEST(Symmetry, FollowsTheFrameAndTheUnit) {
  const Symmetries bottle(SymmetryAxis{{0, 0, 1}, {1, 0, 0}}, {nFold({{1, 0, 0}, {0, 0, 2}}, 2)});
  const Pose T_N_O(expSO3({0, kPi / 2, 0}), {0, 0, 10});  // z becomes x, x becomes -z
  const Symmetries moved = bottle.inFrame(T_N_O);
  EXPECT_LT((moved.axis()->direction - Eigen::Vector3d::UnitX()).norm(), 1e-15);
  EXPECT_LT((moved.axis()->point - Eigen::Vector3d(0, 0, 9)).norm(), 1e-15);
  EXPECT_LT(distance(moved.motions()[1], nFold({{0, 0, -1}, {2, 0, 10}}, 2)), 1e-7);
  const Symmetries scaled = bottle.scaled(0.1);
  EXPECT_NEAR(scaled.axis()->point.x(), 0.1, 1e-15);
  EXPECT_LT(distance(scaled.motions()[1], nFold({{1, 0, 0}, {0, 0, 0.2}}, 2)), 1e-7);
}

TEST(Symmetry, SaysWhatItIs) {
  EXPECT_EQ(describe(Symmetries()), "");
  EXPECT_EQ(describe(Symmetries(kZ, {})), "any turn about an axis");
  EXPECT_EQ(describe(Symmetries(kZ, {nFold(kX, 2)})), "any turn about an axis, and 1 motion");
  EXPECT_EQ(describe(Symmetries(std::nullopt, {nFold(kZ, 4)})), "3 motions");
}

TEST(Symmetry, RoundedNumbersWillDo) {
  Pose quarter;
  quarter.R = nearestRotation((Eigen::Matrix3d() << 0.001, -1, 0, 1, 0, 0.002, 0, 0, 1).finished());
  EXPECT_EQ(Symmetries(std::nullopt, {quarter}).motions().size(), 4u);
}

}  // namespace
}  // namespace nerf_pose_refiner
