// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Depth beside colours in KeyframeRefiner: what it betters, and what it must leave alone.
#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "evaluation/pose_error.h"
#include "refinement/depth_fusion.h"
#include "refinement/keyframe_refiner.h"
#include "support/depth_scene.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::int64_t kImage_ns = 33000000;

class KeyframeDepthTest : public DepthScene, public testing::Test {
 protected:
  Prior nearTruth() const {
    Prior prior;
    prior.T_O_C = fartherBy(truth_, 0.004);
    prior.rotation_rad = 5 * kDegree;
    prior.translation = 0.05;
    return prior;
  }

  Observation with(std::shared_ptr<const DepthImage> depth) const {
    Observation observation = imageAt(truth_);
    observation.depth = std::move(depth);
    return observation;
  }

  std::shared_ptr<const DepthImage> sensor(const DepthErrors& errors) const {
    return depthImage(metresAt(truth_, kColour, {}, errors), kColour);
  }

  /// What the refiner says of an image of a new sequence.
  Refinement follow(const Observation& observation) const {
    return refiner()->follow({observation, 0}, nearTruth());
  }

  void expectColoursAlone(const Observation& observation, const std::string& reason) const {
    const Refinement found = follow(observation), alone = follow(with(nullptr));
    EXPECT_EQ(found.depth.use, DepthUse::kRefused);
    EXPECT_NE(found.depth.message.find(reason), std::string::npos) << found.depth.message;
    EXPECT_EQ(found.T_O_C.t, alone.T_O_C.t);
    EXPECT_EQ(found.T_O_C.R, alone.T_O_C.R);
    EXPECT_EQ(found.covariance, alone.covariance);
    EXPECT_EQ(found.score, alone.score);
  }
};

TEST_F(KeyframeDepthTest, SettlesLessSurelyWhereDepthSeesThroughAPart) {
  ImageOf<float> metres = metresAt(truth_, kColour);
  const Refinement whole = refiner()->settle({with(depthImage(metres, kColour)), 0}, {truth_}, {});
  int shown = 0, seen = 0;
  for (const float z : metres.values) shown += z < 0.95 * kWall_m;
  for (float& z : metres.values) {
    if (z < 0.95 * kWall_m && ++seen < shown / 5) z = kWall_m;
  }
  const Refinement holed = refiner()->settle({with(depthImage(metres, kColour)), 0}, {truth_}, {});
  ASSERT_EQ(whole.depth.use, DepthUse::kUsed) << whole.depth.message;
  ASSERT_EQ(holed.depth.use, DepthUse::kUsed) << holed.depth.message;
  EXPECT_LT(whole.depth.farther, 0.05);
  EXPECT_GT(holed.depth.farther, 0.1);
  const double p = *whole.found_probability, q = *holed.found_probability;
  EXPECT_NEAR(q / (1 - q) / (p / (1 - p)), 0.3, 0.05);
}

TEST_F(KeyframeDepthTest, SettlesAloneFromWhatItLearntBefore) {
  const auto settling = refiner();
  const Observation right = with(sensor({}));
  const Refinement first = settling->settle({right, 0}, {truth_}, {});
  for (int i = 0; i < 8; ++i) {
    settling->settle({with(sensor({0, 0.03})), 0}, {truth_}, {});  // 3 cm off
  }
  const Refinement last = settling->settle({right, 0}, {truth_}, {});
  EXPECT_EQ(first.depth.use, DepthUse::kUsed) << first.depth.message;
  EXPECT_EQ(last.depth.use, DepthUse::kUsed) << last.depth.message;
  EXPECT_NEAR(last.depth.bias_m, first.depth.bias_m, 1e-6);
}

TEST_F(KeyframeDepthTest, TakesPartInThePose) {
  const Refinement alone = follow(with(nullptr));
  EXPECT_EQ(alone.depth.use, DepthUse::kNone);
  const Refinement found = follow(with(sensor({0.001, 0, 0.2, 0.001})));
  EXPECT_EQ(found.depth.use, DepthUse::kUsed) << found.depth.message;
  EXPECT_EQ(found.depth.message, "");
  EXPECT_GT(found.depth.agreeing, 0.9);
  EXPECT_GT(found.depth.measured, 0.4);
  EXPECT_LT(found.depth.measured, 0.9);  // holes
  const Eigen::Vector3d sight = (truth_.t - object().centre).normalized();
  const auto variance = [&](const Refinement& of) {
    return sight.dot(of.covariance.topLeftCorner<3, 3>() * sight);
  };
  EXPECT_LT(variance(found), variance(alone));
  EXPECT_GE(found.score, alone.score - 1e-9);
}

TEST_F(KeyframeDepthTest, TakesPartWhereASensorIsSaidToHaveNoBias) {
  DepthImage depth = *sensor({0.001, 0, 0.2, 0.001});
  depth.noise.bias_m = depth.noise.bias_fraction = 0;
  const auto follower = refiner();
  for (int i = 0; i < 3; ++i) {  // later ones begin with what was learnt of the bias
    const Observation observation = with(std::make_shared<const DepthImage>(depth));
    const Refinement found = follower->follow({observation, i * kImage_ns}, nearTruth());
    EXPECT_EQ(found.depth.use, DepthUse::kUsed) << found.depth.message;
    EXPECT_TRUE(found.T_O_C.isFinite());
    EXPECT_NEAR(found.depth.bias_m, 0, 1e-5);
  }
}

TEST_F(KeyframeDepthTest, LearnsTheBiasSlowly) {
  const auto follower = refiner();
  const Observation observation = with(sensor({0.001, 0.002, 0.1, 0}));
  Prior prior = nearTruth();
  std::vector<double> bias, deviation;
  for (int i = 0; i < 40; ++i) {
    const Refinement found = follower->follow({observation, i * kImage_ns}, prior);
    ASSERT_EQ(found.depth.use, DepthUse::kUsed) << found.depth.message;
    prior.T_O_C = found.T_O_C;
    bias.push_back(found.depth.bias_m);
    deviation.push_back(found.depth.bias_dev_m);
  }
  EXPECT_LT(bias.front(), 0.0005);
  EXPECT_GT(bias.back(), 0.001);
  EXPECT_LT(bias.back(), 0.0025);
  EXPECT_LT(deviation.back(), deviation.front());
  EXPECT_GT(deviation.back(), 0.09 * deviation.front());  // images share their errors
}

TEST_F(KeyframeDepthTest, RefusesMillimetresForMetres) {
  ImageOf<float> metres = metresAt(truth_, kColour);
  for (float& value : metres.values) value *= 1000;
  expectColoursAlone(with(depthImage(metres, kColour)), "unit is wrong");
  for (float& value : metres.values) value *= 1e-6f;
  expectColoursAlone(with(depthImage(metres, kColour)), "unit is wrong");
}

TEST_F(KeyframeDepthTest, RefusesAnotherScale) {
  ImageOf<float> metres = metresAt(truth_, kColour);
  for (float& value : metres.values) value *= 2;
  expectColoursAlone(with(depthImage(metres, kColour)), "2.00 times the distance");
}

TEST_F(KeyframeDepthTest, RefusesEmptyDepth) {
  expectColoursAlone(with(depthImage(ImageOf<float>(320, 240, 1, 0.0f), kColour)),
                     "missing on 100 %");
}

TEST_F(KeyframeDepthTest, RefusesDepthOfAnotherMoment) {
  // The object was 40 mm farther to the right.
  Pose before = truth_;
  before.t -= 0.04 / kUnit_m * truth_.R.col(0);
  expectColoursAlone(with(depthImage(metresAt(before, kColour), kColour)), "");
}

TEST_F(KeyframeDepthTest, RefusesDepthThatLagsBehindTheMotion) {
  // To and fro, by less than a single image could tell.
  const auto follower = refiner();
  const auto at = [&](int i) {
    Pose pose = truth_;
    pose.t += 0.04 / kUnit_m * std::sin(0.25 * i) * truth_.R.col(0);
    return pose;
  };
  Prior prior = nearTruth();
  Refinement found;
  for (int i = 0; i < 40; ++i) {
    Observation image = imageAt(at(i));
    image.depth = depthImage(metresAt(at(i - 2), kColour), kColour);
    prior.T_O_C = at(i);
    found = follower->follow({image, i * kImage_ns}, prior);
    if (found.depth.message.find("later than its stamps") != std::string::npos) break;
  }
  EXPECT_EQ(found.depth.use, DepthUse::kRefused);
  EXPECT_NE(found.depth.message.find("ms later than its stamps"), std::string::npos)
      << found.depth.message;
}

TEST_F(KeyframeDepthTest, AnOffsetOfAStandingObjectIsNoDelay) {
  // The transform between the cameras is a millimetre off.
  const auto follower = refiner();
  Pose beside = truth_;
  beside.t += 0.001 / kUnit_m * truth_.R.col(0);
  Observation image = with(depthImage(metresAt(beside, kColour), kColour));
  Prior prior = nearTruth();
  prior.T_O_C = truth_;
  for (int i = 0; i < 60; ++i) {
    const Refinement found = follower->follow({image, i * kImage_ns}, prior);
    EXPECT_EQ(found.depth.message.find("its stamps"), std::string::npos)
        << i << found.depth.message;
    prior.T_O_C = found.T_O_C;
  }
}

TEST_F(KeyframeDepthTest, RefusesDepthOfAnotherCamera) {
  const Pose other = cameraAround(*scene_, -1.3, 0.9);
  const Camera wide = {320, 240, 250, 250, 120, 140};
  expectColoursAlone(with(depthImage(metresAt(other, wide), kColour)), "");
}

TEST_F(KeyframeDepthTest, RefusesDepthBesideTheObject) {
  const Camera aside = kColour.cropped(400, 0, 320, 240);
  expectColoursAlone(with(depthImage(ImageOf<float>(320, 240, 1, 0.5f), aside)), "does not show");
}

TEST_F(KeyframeDepthTest, AModelWithoutScaleTakesNone) {
  KeyframeSearchSettings settings;
  settings.real_time = false;
  KeyframeRefiner unscaled(backend_.get(), scene_, settings);
  const Refinement found = unscaled.follow({with(sensor({})), 0}, nearTruth());
  EXPECT_EQ(found.depth.use, DepthUse::kRefused);
  EXPECT_NE(found.depth.message.find("scale"), std::string::npos);
}

TEST_F(KeyframeDepthTest, APlaceThatIsSeenToBeEmptyIsNotTrusted) {
  const auto follower = refiner();
  Prior prior = nearTruth();
  const Observation right = with(sensor({0.001, 0, 0.1, 0}));
  for (int i = 0; i < 10; ++i) {
    prior.T_O_C = follower->follow({right, i * kImage_ns}, prior).T_O_C;
  }
  // Colours show the object, on a poster say, where depth sees the wall.
  const Observation poster = with(depthImage(ImageOf<float>(320, 240, 1, 0.7f), kColour));
  const Refinement found = follower->follow({poster, 10 * kImage_ns}, prior);
  const Refinement alone = follow(with(nullptr));
  EXPECT_EQ(found.depth.use, DepthUse::kRefused);
  EXPECT_GT(found.depth.farther, 0.9);
  EXPECT_LT(found.score, 0.9);
  EXPECT_LT(found.score, alone.score);
  // A sensor that has never agreed is no evidence.
  EXPECT_EQ(follow(poster).score, alone.score);
}

TEST_F(KeyframeDepthTest, DepthAlonePutsTheObjectNearAPrior) {
  const auto keyframe =
      std::make_shared<const KeyframePoints>(renderKeyframe(*field_, {kColour, truth_}));
  Prior prior = nearTruth();
  const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(0.04, -0.05, 0.03));
  prior.T_O_C = {turn * truth_.R, object().centre + Eigen::Vector3d(0.03, 0.03, -0.02) +
                                      turn * (truth_.t - object().centre)};
  DepthFusion fusion;
  const auto found = fusion.alone(*sensor({0.001, 0, 0.2, 0.001}), keyframe, object(), prior);
  ASSERT_TRUE(found);
  const PoseError error = poseError(*found, truth_, object().centre, kColour);
  EXPECT_LT(error.rotation_rad / kDegree, 0.7);
  EXPECT_LT(error.object_offset / object().diameter, 0.01);
  const auto wall = depthImage(ImageOf<float>(320, 240, 1, 0.9f), kColour);
  EXPECT_FALSE(fusion.alone(*wall, keyframe, object(), prior));
}

TEST_F(KeyframeDepthTest, LooksPastWhatHidesTheObject) {
  Observation observation = imageAt(truth_);
  ImageOf<float> metres = metresAt(truth_, kColour, {}, {0.001, 0, 0.1, 0});
  for (int y = 60; y < 180; ++y) {
    for (int x = 115; x < 152; ++x) {
      metres.at(x, y, 0) = 0.3f;
      for (int c = 0; c < 3; ++c) {
        observation.image.at(x, y, c) = (x / 6 + y / 6 + c) % 2 ? 0.9f : 0.1f;
      }
    }
  }
  const Refinement alone = follow(observation);
  observation.depth = depthImage(metres, kColour);
  const Refinement found = refiner()->find({observation, 0}, nearTruth());
  EXPECT_EQ(found.depth.use, DepthUse::kUsed) << found.depth.message;
  EXPECT_GT(found.score, 0.9);
  EXPECT_GT(found.hypotheses.front().score, alone.hypotheses.front().score);
}

}  // namespace
}  // namespace nerf_pose_refiner
