// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/depth_residual.h"

#include <gtest/gtest.h>

#include <cmath>

#include "math/keyframe_alignment.h"

namespace nerf_pose_refiner {
namespace {

const Vec3<double> kMiddle = {0.3, -0.2, 0.1};  // of the object, in O

PlaneDepth<double> depthAt(const CameraPose<double>& pose, const SurfacePlace<double>& place,
                           const Vec3<double>& ray) {
  PlaneDepth<double> found = {};
  const Vec3<double> q = inCamera(pointTransform(pose, kMiddle), place.p);
  EXPECT_TRUE(planeDepth(place, q, pose.R, ray, &found));
  return found;
}

TEST(DepthResidual, DepthOfATiltedPlane) {
  // The plane z = 2 + x, seen along z: on the ray (0.5, 0, 1) it lies at 4.
  const CameraPose<double> pose = {expSO3(Vec3<double>{0, 0, 0}), kMiddle - Vec3<double>{0, 0, 2}};
  const SurfacePlace<double> place = {{0, 0, 0}, {1, 0, -1}};
  const PlaneDepth<double> found = depthAt(pose, place, {0.5, 0, 1});
  EXPECT_NEAR(found.depth, 4, 1e-12);
  // The camera moves on by v along z: 2 - v + x, met at 2 (2 - v). To the right by v: the plane is
  // 2 + (x + v), met at 2 (2 + v).
  EXPECT_NEAR(found.jacobian[2], -2, 1e-12);
  EXPECT_NEAR(found.jacobian[0], 2, 1e-12);
  EXPECT_NEAR(found.jacobian[1], 0, 1e-12);
  // 2 / (1 - s) on the ray (s, 0, 1): its derivative by s is 2 / (1 - s)^2.
  EXPECT_NEAR(found.slope, 8, 1e-12);
}

TEST(DepthResidual, JacobianAgainstCentralDifferences) {
  constexpr double kStep = 1e-5;
  const CameraPose<double> pose = {expSO3(Vec3<double>{0.3, -0.5, 0.2}),
                                   kMiddle + Vec3<double>{-0.9, -0.2, -1.8}};
  const SurfacePlace<double> place = {{0.11, -0.07, 0.05}, {-0.3, 0.4, -0.9}};
  const Vec3<double> q = inCamera(pointTransform(pose, kMiddle), place.p);
  const Vec3<double> ray = {q.x / q.z + 0.02, q.y / q.z - 0.03, 1};  // beside the place
  const PlaneDepth<double> found = depthAt(pose, place, ray);
  for (int axis = 0; axis < 6; ++axis) {
    const auto at = [&](double step) {
      double x[6] = {};
      x[axis] = step;
      return depthAt(moveCamera(pose, kMiddle, {x[0], x[1], x[2]}, {x[3], x[4], x[5]}), place, ray)
          .depth;
    };
    const double difference = (at(kStep) - at(-kStep)) / (2 * kStep);
    EXPECT_NEAR(found.jacobian[axis], difference, 1e-6 * (1 + std::abs(difference))) << axis;
  }
}

TEST(DepthResidual, SurfacesSeenEdgeOnOrFromBehindHaveNone) {
  const Mat3<double> R = expSO3(Vec3<double>{0, 0, 0});
  const Vec3<double> q = {0, 0, 2}, ray = {0, 0, 1};
  PlaneDepth<double> unused;
  EXPECT_FALSE(planeDepth<double>({{0, 0, 0}, {0, 0, 1}}, q, R, ray, &unused));
  EXPECT_FALSE(planeDepth<double>({{0, 0, 0}, {1, 0, -0.1}}, q, R, ray, &unused));
  EXPECT_TRUE(planeDepth<double>({{0, 0, 0}, {1, 0, -0.5}}, q, R, ray, &unused));
}

}  // namespace
}  // namespace nerf_pose_refiner
