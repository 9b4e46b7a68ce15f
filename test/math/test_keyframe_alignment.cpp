// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/keyframe_alignment.h"

#include <gtest/gtest.h>

#include <cmath>

namespace nerf_pose_refiner {
namespace {

const Pinhole<double> kPinhole = {300, 320, 40, 30};
const Vec3<double> kCentre = {0.3, -0.2, 0.1};
const Vec3<double> kPoint = {0.11, -0.07, 0.05};  // relative to the centre
const RenderedPoint<double> kRendered = {{0.4, -0.3, 0.9}, {}, {}};
const LocalColours<double> kLocal = {{0.3, 0.5, 0.2}, {4.0, 3.0, 5.0}};

CameraPose<double> poseBefore() {
  return {expSO3(Vec3<double>{0.3, -0.5, 0.2}), kCentre + Vec3<double>{-0.9, -0.2, -1.8}};
}

// An image that bilinear interpolation has exactly, so that differences of it have no corners.
InterpolatedPixel<double> imageAt(const Pixel<double>& pixel, int channel) {
  const double a = 0.2 + 0.1 * channel, b = 0.013 - 0.02 * channel, c = 0.011 * channel, d = 4e-4;
  return {a + b * pixel.u + c * pixel.v + d * pixel.u * pixel.v, b + d * pixel.v, c + d * pixel.u};
}

PointResidual<double> residualAt(const CameraPose<double>& pose) {
  const Vec3<double> q = inCamera(pointTransform(pose, kCentre), kPoint);
  InterpolatedPixel<double> observed[3];
  for (int c = 0; c < 3; ++c) observed[c] = imageAt(project(kPinhole, q), c);
  return pointResidual(kRendered, observed, kLocal, 1.0);
}

PixelFlow<double> flowAt(const CameraPose<double>& pose) {
  const PointTransform<double> transform = pointTransform(pose, kCentre);
  return pointFlow(kPinhole, transform, kPoint, inCamera(transform, kPoint));
}

CameraPose<double> movedAlong(const CameraPose<double>& pose, int axis, double step) {
  double x[6] = {};
  x[axis] = step;
  return moveCamera(pose, kCentre, {x[0], x[1], x[2]}, {x[3], x[4], x[5]});
}

TEST(KeyframeAlignment, JacobianAgainstCentralDifferences) {
  constexpr double kStep = 1e-5;
  const CameraPose<double> pose = poseBefore();
  const PointResidual<double> r = residualAt(pose);
  const PixelFlow<double> flow = flowAt(pose);
  for (int axis = 0; axis < 6; ++axis) {
    const PointResidual<double> ahead = residualAt(movedAlong(pose, axis, kStep));
    const PointResidual<double> behind = residualAt(movedAlong(pose, axis, -kStep));
    for (int c = 0; c < 3; ++c) {
      const double difference = (ahead.value[c] - behind.value[c]) / (2 * kStep);
      EXPECT_NEAR(r.du[c] * flow.u[axis] + r.dv[c] * flow.v[axis], difference,
                  1e-6 * (1 + std::abs(difference)))
          << "axis " << axis << ", channel " << c;
    }
  }
}

TEST(KeyframeAlignment, PointFlowIsPixelFlow) {
  const PixelFlow<double> expected = pixelFlow(kPinhole, poseBefore(), kCentre, kPoint);
  const PixelFlow<double> flow = flowAt(poseBefore());
  for (int i = 0; i < 6; ++i) {
    EXPECT_NEAR(flow.u[i], expected.u[i], 1e-10);
    EXPECT_NEAR(flow.v[i], expected.v[i], 1e-10);
  }
}

TEST(KeyframeAlignment, GradientOfTheRobustCostAgainstCentralDifferences) {
  constexpr double kStep = 1e-5, kScale = 0.7, kWeight = 0.6;
  const auto sumsAt = [&](const CameraPose<double>& pose) {
    PointSums<double> sums = {};
    addPoint(flowAt(pose), residualAt(pose), kWeight, kScale, &sums);
    return sums;
  };
  const PointSums<double> sums = sumsAt(poseBefore());
  for (int axis = 0; axis < 6; ++axis) {
    const double difference = (sumsAt(movedAlong(poseBefore(), axis, kStep)).cost -
                               sumsAt(movedAlong(poseBefore(), axis, -kStep)).cost) /
                              (2 * kStep);
    EXPECT_NEAR(sums.gradient[axis], difference, 1e-6 * (1 + std::abs(difference)));
  }
}

TEST(KeyframeAlignment, InformationIsOfTheWeightedJacobian) {
  const PixelFlow<double> flow = {{1, 2, 0, 0, 0, 3}, {0, 1, 0, 0, 0, -1}};
  const PointResidual<double> r = {{0.5, 0, 0}, {2, 0, 1}, {0, 1, 0}, 1};
  PointSums<double> sums = {};
  addPoint(flow, r, 1.0, 0.5, &sums);
  // r^2 = 0.25 = scale^2: the weight is 1 / (1 + 1)^2, the cost 0.25 / 2 / 2.
  EXPECT_DOUBLE_EQ(sums.robust_weight, 0.25);
  EXPECT_DOUBLE_EQ(sums.cost, 0.0625);
  // Rows of J: (2, 4, .., 6), (0, 1, .., -1), (1, 2, .., 3).
  EXPECT_DOUBLE_EQ(sums.information[0], 0.25 * (4 + 1));        // (0, 0)
  EXPECT_DOUBLE_EQ(sums.information[1], 0.25 * (8 + 2));        // (1, 0)
  EXPECT_DOUBLE_EQ(sums.information[2], 0.25 * (16 + 1 + 4));   // (1, 1)
  EXPECT_DOUBLE_EQ(sums.information[20], 0.25 * (36 + 1 + 9));  // (5, 5)
  EXPECT_DOUBLE_EQ(sums.gradient[1], 0.25 * 4 * 0.5);
}

TEST(KeyframeAlignment, InterpolatesBetweenFourPixels) {
  const InterpolatedPixel<double> pixel =
      interpolate(PixelQuad<double, double>{1, 3, 5, 11, 0.25, 0.5});
  EXPECT_DOUBLE_EQ(pixel.value, 4);  // (1.5 + 6.5) / 2
  EXPECT_DOUBLE_EQ(pixel.du, 4);     // (2 + 6) / 2
  EXPECT_DOUBLE_EQ(pixel.dv, 5);     // 6.5 - 1.5
}

TEST(KeyframeAlignment, LocalColoursAreMeansAndDeviations) {
  // Two pixels, (0, 0.4, 1) and (0.6, 0.4, 0.8): variances 0.09, 0, 0.01.
  const double sums[kLocalSums] = {0.6, 0.8, 1.8, 0.36, 0.32, 1.64};
  const LocalColours<double> local = localColours(sums, 0.5);
  EXPECT_DOUBLE_EQ(local.mean[0], 0.3);
  EXPECT_DOUBLE_EQ(local.mean[2], 0.9);
  EXPECT_NEAR(local.inverse_deviation[0], 1 / std::sqrt(0.09 + 9e-4), 1e-5);
  EXPECT_NEAR(local.inverse_deviation[1], 1 / 0.03, 1e-5);
  EXPECT_NEAR(local.inverse_deviation[2], 1 / std::sqrt(0.01 + 9e-4), 1e-5);
}

TEST(KeyframeAlignment, FlatColoursAreNotBlownUp) {
  const double sums[kLocalSums] = {0.5, 0.5, 0.5, 0.25 - 1e-12, 0.25, 0.25};  // below 0 by rounding
  EXPECT_NEAR(localColours(sums, 1.0).inverse_deviation[0], 1 / 0.03, 1e-3);
}

TEST(KeyframeAlignment, CarriesGradientsOverASurface) {
  // A pixel of the other image to the right is (2, 1) here, one down is (0, 3).
  const ProjectionJacobian<double> projection = {{1, 0, 0}, {0, 1, 0}};
  const Vec3<double> tangent[2] = {{2, 1, 9}, {0, 3, 9}};
  const Pixel<double> here = {0.5, -1};
  const Pixel<double> other = {2 * here.u + 1 * here.v, 3 * here.v};
  const Pixel<double> carried = carriedGradient(projection, tangent, other);
  EXPECT_DOUBLE_EQ(carried.u, here.u);
  EXPECT_DOUBLE_EQ(carried.v, here.v);
  const Vec3<double> edge_on[2] = {{2, 1, 0}, {4, 2, 0}};
  EXPECT_EQ(carriedGradient(projection, edge_on, other).u, 0);
}

}  // namespace
}  // namespace nerf_pose_refiner
