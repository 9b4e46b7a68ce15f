// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/depth_fit.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "evaluation/pose_error.h"
#include "geometry/matrix6.h"
#include "refinement/depth_delay.h"
#include "refinement/depth_occlusion.h"
#include "support/depth_scene.h"

namespace nerf_pose_refiner {
namespace {

class DepthFitTest : public DepthScene, public testing::Test {
 protected:
  /// @param deviation of the object's place [m], of its rotation [rad / 10 m].
  DepthPrior priorAt(const Pose& T_O_C, double deviation_m, double bias_deviation_m) const {
    DepthPrior prior;
    prior.T_O_C = T_O_C;
    Vector6 variance;
    variance << Eigen::Vector3d::Constant(std::pow(deviation_m / kUnit_m, 2)),
        Eigen::Vector3d::Constant(std::pow(10 * deviation_m, 2));
    prior.covariance = variance.asDiagonal();
    prior.bias_variance = std::pow(bias_deviation_m / kUnit_m, 2);
    return prior;
  }

  DepthFit fit(const DepthImage& depth, const DepthPrior& prior) const {
    return fitDepth(surface_, depth, prior, object());
  }

  /// Turned and moved as no symmetry of the scene allows.
  Pose offBy(double deg, double fraction) const {
    const Eigen::Vector3d direction(0.6, -0.5, 0.6);
    const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(deg * kDegree * direction));
    return {turn * truth_.R, object().centre + fraction * object().diameter * direction +
                                 turn * (truth_.t - object().centre)};
  }

  KeyframePoints keyframe_ = renderKeyframe(*field_, {kColour, truth_});
  DepthSurface surface_ = depthSurfaceOf(keyframe_);
};

TEST_F(DepthFitTest, SurfaceLiesOnTheObjectAndFacesTheCamera) {
  ASSERT_GT(surface_.places.size(), 300u);
  int on_box = 0;
  for (const SurfacePlace<double>& place : surface_.places) {
    const Eigen::Vector3d p = Eigen::Vector3d(place.p.x, place.p.y, place.p.z) + object().centre;
    const Eigen::Vector3d n(place.n.x, place.n.y, place.n.z);
    EXPECT_NEAR(n.norm(), 1, 1e-6);
    EXPECT_GT(n.dot(truth_.t - p), 0);
    // A side of the box, whose normal is an axis, where its neighbours are on the same side, too.
    on_box += n.cwiseAbs().maxCoeff() > 0.999;
  }
  EXPECT_GT(on_box, static_cast<int>(surface_.places.size()) / 2);
}

TEST_F(DepthFitTest, FindsThePoseByDepthAlone) {
  const auto depth = depthImage(metresAt(truth_, kColour), kColour);
  const DepthFit found = fit(*depth, priorAt(offBy(3, 0.04), 0.02, 1e-6));
  const PoseError error = poseError(found.T_O_C, truth_, object().centre, kColour);
  EXPECT_LT(error.rotation_rad / kDegree, 0.3);
  EXPECT_LT(error.object_offset / object().diameter, 0.004);
  EXPECT_GT(found.counts.agreeing, 0.95 * found.counts.measured);
  EXPECT_NEAR(found.median_ratio, 1, 0.03);
}

TEST_F(DepthFitTest, ACameraBesideAtAnotherResolutionSaysTheSame) {
  const Camera other = {200, 160, 210, 205, 101, 77};
  const Pose T_C_D(expSO3(Eigen::Vector3d(0.02, -0.03, 0.05)), Eigen::Vector3d(0.05, -0.01, 0.02));
  const auto depth = depthImage(metresAt(truth_, other, T_C_D), other, T_C_D);
  const DepthFit found = fit(*depth, priorAt(offBy(3, 0.04), 0.02, 1e-6));
  const PoseError error = poseError(found.T_O_C, truth_, object().centre, kColour);
  EXPECT_LT(error.rotation_rad / kDegree, 0.4);
  EXPECT_LT(error.object_offset / object().diameter, 0.006);
}

TEST_F(DepthFitTest, OffsetGoesToPoseAndBiasByTheirVariances) {
  // A wall half a metre ahead, of which nothing but its distance can be told.
  const Pose ahead(Eigen::Matrix3d::Identity(),
                   object().centre - 0.5 / kUnit_m * Eigen::Vector3d::UnitZ());
  PointColumns shown;
  DepthSurface wall;
  for (int i = 0; i < 400; ++i) {
    const SurfacePlace<double> place = {{0.02 * (i % 20 - 9.5), 0.02 * (i / 20 - 9.5), 0},
                                        {0, 0, -1}};
    wall.places.push_back(place);
    wall.cell.push_back(i);
    wall.tile.push_back(i / 25);
    shown.x.push_back(static_cast<float>(place.p.x));
    shown.y.push_back(static_cast<float>(place.p.y));
    shown.z.push_back(0);
    shown.cell.push_back(i);
  }
  wall.tiles = 16;
  wall.spacing = wall.shown_px = 0.02;
  wall.shown = &shown;
  const auto depth = depthImage(ImageOf<float>(320, 240, 1, 0.504f), kColour);
  const auto farther = [&](double pose_m, double bias_m, DepthFit* found) {
    DepthPrior prior = priorAt(ahead, pose_m, bias_m);
    prior.covariance.bottomRightCorner<3, 3>() *= 1e-6;
    *found = fitDepth(wall, *depth, prior, object());
    return kUnit_m * (object().centre.z() - found->T_O_C.t.z()) - 0.5;
  };
  DepthFit found;
  // Of an offset of 4 mm, the share of the pose is s^2 / (s^2 + b^2), if the noise is small.
  EXPECT_NEAR(farther(0.003, 0.003, &found), 0.002, 1e-4);
  EXPECT_NEAR(kUnit_m * found.bias, 0.002, 1e-4);
  EXPECT_NEAR(farther(0.006, 0.003, &found), 0.0032, 1e-4);
  EXPECT_NEAR(kUnit_m * found.bias, 0.0008, 1e-4);
  // Which of them is unknown: the deviation along the line of sight is s b / sqrt(s^2 + b^2).
  EXPECT_NEAR(kUnit_m * std::sqrt(found.covariance(2, 2)), 0.006 / std::sqrt(5.0), 1e-4);
  EXPECT_NEAR(kUnit_m * std::sqrt(found.bias_variance), 0.006 / std::sqrt(5.0), 1e-4);
  // Sideways nothing was learnt.
  EXPECT_NEAR(kUnit_m * std::sqrt(found.covariance(0, 0)), 0.006, 1e-4);
}

TEST_F(DepthFitTest, ErrorsAreAsLargeAsTheCovarianceSays) {
  constexpr int kTrials = 60;
  double sum = 0;
  for (int i = 0; i < kTrials; ++i) {
    const DepthErrors errors = {0.002, 0, 0.2, 0.001, static_cast<std::uint64_t>(100 + i)};
    const auto depth = depthImage(metresAt(truth_, kColour, {}, errors), kColour);
    const DepthFit found = fit(*depth, priorAt(offBy(0.5, 0.01), 0.02, 1e-6));
    const Vector6 away = cameraTwist(found.T_O_C, truth_, object().centre);
    sum += squaredDistance(away, found.covariance) / 6;
  }
  EXPECT_GT(sum / kTrials, 0.4);
  EXPECT_LT(sum / kTrials, 1.6);
}

TEST_F(DepthFitTest, WhatIsNearerOrFartherHasNoSay) {
  ImageOf<float> metres = metresAt(truth_, kColour);
  for (int y = 60; y < 120; ++y) {
    for (int x = 120; x < 160; ++x) metres.at(x, y, 0) = 0.35f;
    for (int x = 165; x < 190; ++x) metres.at(x, y, 0) = 1.5f;
  }
  const auto depth = depthImage(metres, kColour);
  const DepthFit found = fit(*depth, priorAt(offBy(1, 0.01), 0.02, 1e-6));
  const PoseError error = poseError(found.T_O_C, truth_, object().centre, kColour);
  EXPECT_LT(error.rotation_rad / kDegree, 0.3);
  EXPECT_LT(error.object_offset / object().diameter, 0.005);
  EXPECT_GT(found.counts.nearer, found.counts.measured / 20);
  EXPECT_GT(found.counts.farther, found.counts.measured / 40);
}

TEST_F(DepthFitTest, FlyingPixelsAtEdgesDoNotCount) {
  // Each pixel the mean of its neighbourhood: beside edges there is a depth at which nothing is.
  const ImageOf<float> sharp = metresAt(truth_, kColour);
  ImageOf<float> metres = sharp;
  for (int y = 3; y + 3 < metres.height; ++y) {
    for (int x = 3; x + 3 < metres.width; ++x) {
      float sum = 0;
      for (int k = 0; k < 49; ++k) sum += sharp.at(x + k % 7 - 3, y + k / 7 - 3, 0);
      metres.at(x, y, 0) = sum / 49;
    }
  }
  const DepthFit found = fit(*depthImage(metres, kColour), priorAt(truth_, 0.02, 1e-6));
  EXPECT_LT(found.counts.measured, found.counts.facing);
  EXPECT_GT(found.counts.agreeing, 0.95 * found.counts.measured);
}

TEST_F(DepthFitTest, OccludersLoseTheirWeightAndTheObjectKeepsIts) {
  ImageOf<float> metres = metresAt(truth_, kColour);
  for (int y = 60; y < 180; ++y) {
    for (int x = 100; x < 150; ++x) metres.at(x, y, 0) = 0.3f;
  }
  Observation observation = imageAt(truth_);
  observation.depth = depthImage(metres, kColour);
  const auto weight = weightWithoutOccluders(observation, keyframe_, truth_, {kUnit_m, 0.01});
  ASSERT_TRUE(weight);
  EXPECT_EQ(weight->at(140, 120, 0), 0);  // before the object
  EXPECT_EQ(weight->at(170, 120, 0), 1);  // the object
  EXPECT_EQ(weight->at(10, 10, 0), 1);    // the wall
  observation.depth = depthImage(metresAt(truth_, kColour), kColour);
  EXPECT_FALSE(weightWithoutOccluders(observation, keyframe_, truth_, {kUnit_m, 0.01}));
  // A sensor that sees everything much too near is not believed.
  observation.depth = depthImage(ImageOf<float>(320, 240, 1, 0.001f), kColour);
  EXPECT_FALSE(weightWithoutOccluders(observation, keyframe_, truth_, {kUnit_m, 0.01}));
}

/// An image in which the object moves and depth shows it as it was `delay_s` ago.
DelayEvidence lagging(double delay_s, const Vector6& motion, const Vector6& noise) {
  DelayEvidence image;
  image.motion = motion;
  image.away = -delay_s * motion + noise;
  Vector6 deviation;
  deviation << 0.002, 0.002, 0.004, 0.01, 0.01, 0.01;
  image.covariance = deviation.cwiseAbs2().asDiagonal();
  return image;
}

Vector6 motionOf(double x, double z, double turn) {
  Vector6 motion;
  motion << x, 0, z, 0, turn, 0;
  return motion;
}

TEST(DepthDelay, IsFoundInMotionsOfAnyDirection) {
  DepthDelay delay;
  EXPECT_FALSE(delay.found_s());
  for (int i = 0; i < 30; ++i) {
    const double phase = 0.4 * i;
    const Vector6 motion = motionOf(0.2 * std::sin(phase), 0.1 * std::cos(phase), 0.5);
    const Vector6 noise = 0.001 * std::sin(7.0 * i) * Vector6::Ones();
    delay.learn(lagging(0.066, motion, noise));
  }
  ASSERT_TRUE(delay.found_s());
  EXPECT_NEAR(*delay.found_s(), 0.066, 0.004);
}

TEST(DepthDelay, AnOffsetIsNoDelay) {
  // A wrong place of the depth camera: always the same way, whatever the motion.
  DepthDelay delay;
  for (int i = 0; i < 200; ++i) {
    const double phase = 0.4 * i;
    const Vector6 motion = motionOf(0.2 * std::sin(phase), 0.1 * std::cos(phase), 0);
    delay.learn(lagging(0, motion, 0.004 * Vector6::Ones()));
  }
  EXPECT_FALSE(delay.found_s());
}

TEST(DepthDelay, StandingStillSaysNothing) {
  DepthDelay delay;
  for (int i = 0; i < 200; ++i)
    delay.learn(lagging(0.066, Vector6::Zero(), 0.003 * Vector6::Ones()));
  EXPECT_FALSE(delay.found_s());
}

TEST(DepthDelay, IsForgottenOnceStampsAreRight) {
  DepthDelay delay;
  const Vector6 motion = motionOf(0.2, 0.1, 0.5);
  for (int i = 0; i < 30; ++i) delay.learn(lagging(-0.05, motion, Vector6::Zero()));
  ASSERT_TRUE(delay.found_s());
  EXPECT_LT(*delay.found_s(), 0) << "early";
  for (int i = 0; i < 200; ++i) delay.learn(lagging(0, motion, Vector6::Zero()));
  EXPECT_FALSE(delay.found_s());
}

}  // namespace
}  // namespace nerf_pose_refiner
