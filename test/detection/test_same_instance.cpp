// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/same_instance.h"

#include <gtest/gtest.h>

#include <vector>

#include "detection/object_detector.h"
#include "field/field.h"

namespace nerf_pose_refiner {
namespace {

TEST(IsOutdone, ByALikelierPoseOfTheSamePlaceAlone) {
  Field field;
  field.metadata.diameter = 1;
  const SameInstance is_same(field);
  const auto found = [](double x, double probability) {
    Refinement one;
    one.T_O_C = Pose(Eigen::Matrix3d::Identity(), {x, 0, 4}).inverse();
    one.found_probability = probability;
    return one;
  };
  EXPECT_TRUE(isOutdone(found(0, 0.95), {found(0.1, 0.97)}, is_same));
  EXPECT_FALSE(isOutdone(found(0, 0.95), {found(0.1, 0.9)}, is_same)) << "less likely";
  EXPECT_FALSE(isOutdone(found(0, 0.95), {found(1, 0.97)}, is_same)) << "elsewhere";
  EXPECT_FALSE(isOutdone(found(0, 0.95), {}, is_same));
  EXPECT_TRUE(isOutdone(found(0, 0.95), {found(1, 0.97), found(0, 0.96)}, is_same)) << "any";
}

TEST(SameInstance, IsNearlyAtTheSamePlaceAndAsFar) {
  Field field;
  field.metadata.diameter = 1;
  const auto at = [](double x, double z) {
    return Pose(Eigen::Matrix3d::Identity(), {x, 0, z}).inverse();
  };
  const SameInstance of_cube(field);  // its box has sides of 1
  EXPECT_TRUE(of_cube(at(0, 4), at(0.3, 4)));
  EXPECT_FALSE(of_cube(at(0, 4), at(0.4, 4)));
  EXPECT_TRUE(of_cube(at(0, 4), at(0, 4.8)));  // log 1.2 = 0.18
  EXPECT_FALSE(of_cube(at(0, 4), at(0, 5)));
  field.metadata.box = Box{{0, 0, 0}, {0.3, 0.3, 1}};  // a bottle
  EXPECT_TRUE(SameInstance(field)(at(0, 4), at(0.2, 4)));
  EXPECT_FALSE(SameInstance(field)(at(0, 4), at(0.3, 4)));
  field.metadata.box = Box{{0, 0, 0}, {0.01, 0.01, 1}};  // poses of a needle are not exact, either
  EXPECT_TRUE(SameInstance(field)(at(0, 4), at(0.14, 4)));
}

}  // namespace
}  // namespace nerf_pose_refiner
