// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/projection.h"

#include <gtest/gtest.h>

namespace nerf_pose_refiner {
namespace {

const Pinhole<double> kCamera = {500, 400, 319.5, 239.5};

TEST(Projection, ByHand) {
  const Pixel<double> pixel = project(kCamera, Vec3<double>{0.2, -0.1, 2});
  EXPECT_DOUBLE_EQ(pixel.u, 369.5);
  EXPECT_DOUBLE_EQ(pixel.v, 219.5);
}

TEST(Projection, JacobianByHand) {
  const ProjectionJacobian<double> J = projectionJacobian(kCamera, Vec3<double>{0.2, -0.1, 2});
  EXPECT_DOUBLE_EQ(J.du.x, 250);
  EXPECT_DOUBLE_EQ(J.du.y, 0);
  EXPECT_DOUBLE_EQ(J.du.z, -25);
  EXPECT_DOUBLE_EQ(J.dv.x, 0);
  EXPECT_DOUBLE_EQ(J.dv.y, 200);
  EXPECT_DOUBLE_EQ(J.dv.z, 10);
}

TEST(Projection, MoveCameraByHand) {
  // A quarter turn about z through c = (1, 0, 0) takes the centre (2, 0, 0) to (1, 1, 0).
  const CameraPose<double> start = {expSO3(Vec3<double>{0, 0, 0}), {2, 0, 0}};
  const CameraPose<double> moved =
      moveCamera(start, {1, 0, 0}, {0, 0, 0.5}, {0, 0, 1.5707963267948966});
  EXPECT_NEAR(moved.o.x, 1, 1e-15);
  EXPECT_NEAR(moved.o.y, 1, 1e-15);
  EXPECT_NEAR(moved.o.z, 0.5, 1e-15);
  EXPECT_NEAR(moved.R.m[1][0], 1, 1e-15);
}

TEST(Projection, CameraToTheRightMovesTheImageToTheLeft) {
  const CameraPose<double> pose = {expSO3(Vec3<double>{0, 0, 0}), {0, 0, -2}};
  const PixelFlow<double> flow = pixelFlow(kCamera, pose, {0, 0, 0}, {0, 0, 0});
  // The pixel sees what was 250 px per unit further right: dC = +dC/du * 250 per unit.
  EXPECT_DOUBLE_EQ(flow.u[0], 250);
  EXPECT_DOUBLE_EQ(flow.v[1], 200);
  EXPECT_DOUBLE_EQ(flow.u[1], 0);
  for (int i = 3; i < 6; ++i) EXPECT_DOUBLE_EQ(flow.u[i], 0);  // p is the centre of the rotation
}

TEST(Projection, FlowAgreesWithCentralDifferencesOnAllSixAxes) {
  constexpr double kStep = 1e-6;
  const CameraPose<double> pose = {expSO3(Vec3<double>{0.3, -1.1, 0.4}), {1.9, 0.6, -1.2}};
  const Vec3<double> c = {0.1, -0.2, 0.3};
  // A point 2.5 units in front of the camera, off its axis.
  const Vec3<double> p = pose.R * Vec3<double>{0.3, -0.2, 2.5} + pose.o - c;
  const PixelFlow<double> flow = pixelFlow(kCamera, pose, c, p);
  for (int i = 0; i < 6; ++i) {
    double xi[6] = {};
    const auto pixelAt = [&](double step) {
      xi[i] = step;
      const CameraPose<double> moved =
          moveCamera(pose, c, {xi[0], xi[1], xi[2]}, {xi[3], xi[4], xi[5]});
      return project(kCamera, transposedTimes(moved.R, p + c - moved.o));
    };
    const Pixel<double> ahead = pixelAt(kStep);
    const Pixel<double> behind = pixelAt(-kStep);
    // The image at a fixed pixel changes by the opposite of the point's motion.
    EXPECT_NEAR(flow.u[i], -(ahead.u - behind.u) / (2 * kStep), 1e-5) << "axis " << i;
    EXPECT_NEAR(flow.v[i], -(ahead.v - behind.v) / (2 * kStep), 1e-5) << "axis " << i;
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
