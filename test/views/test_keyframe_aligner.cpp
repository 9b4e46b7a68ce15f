// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/keyframe_aligner.h"

#include <gtest/gtest.h>

#include <Eigen/LU>

#include <cmath>
#include <random>
#include <stdexcept>

#include "backend/make_backend.h"
#include "evaluation/pose_error.h"
#include "image/colour.h"
#include "support/keyframe_scene.h"

namespace nerf_pose_refiner {
namespace {

class KeyframeAlignerOnScene : public testing::Test, protected KeyframeScene {
 protected:
  Hypothesis align(const Image& image, const KeyframePoints& keyframe, const Pose& start,
                   const std::string& instruction_set = "auto") const {
    const auto aligner = makeCpuKeyframeAligner(1, instruction_set);
    aligner->observe(observed(image), frameWindowFor(keyframe, kCamera, start));
    const int number = aligner->add(std::make_shared<const KeyframePoints>(keyframe));
    return aligner->align({{number, start}}, {}, {}).front();
  }

  void expectFound(const Hypothesis& found, double deg, double fraction) const {
    const PoseError error = poseError(found.T_O_C, truth_, object().centre, kCamera);
    EXPECT_LT(error.rotation_rad / kDegree, deg);
    EXPECT_LT(error.object_offset / object().diameter, fraction);
  }

  // Starts about and along each axis, both ways.
  void expectFoundFromAround(const Image& image, double start_deg, double deg, double fraction) {
    const KeyframePoints keyframe = keyframeAt(offBy(truth_, {0.6, 0.5, -0.6}, 6));
    for (int axis = 0; axis < 3; ++axis) {
      for (const double sign : {-1, 1}) {
        SCOPED_TRACE(testing::Message() << "axis " << axis << ", sign " << sign);
        const Pose start = offBy(truth_, sign * Eigen::Vector3d::Unit(axis), start_deg);
        expectFound(align(image, keyframe, start), deg, fraction);
      }
    }
  }
};

TEST_F(KeyframeAlignerOnScene, StaysAtThePoseItself) {
  const Hypothesis found = align(imageOf(truth_), keyframeAt(truth_), truth_);
  expectFound(found, 0.1, 0.002);
  EXPECT_GT(found.visible_fraction, 0.9);
}

TEST_F(KeyframeAlignerOnScene, ComesBackFromAGridOfOffsets) {
  expectFoundFromAround(imageOf(truth_), 5, 0.21, 0.003);
}

TEST_F(KeyframeAlignerOnScene, SaysHowFarBesideItsKeyframeIs) {
  EXPECT_LT(align(imageOf(truth_), keyframeAt(truth_), truth_).beside_rad, 0.2 * kDegree);
  const Eigen::Vector3d& centre = object().centre;
  const Eigen::Vector3d sight = centre - truth_.t;
  const Eigen::Vector3d across = sight.cross(Eigen::Vector3d::UnitX()).normalized();
  const Eigen::Matrix3d turn = expSO3(6 * kDegree * across);
  const Pose beside = {turn * truth_.R, centre + turn * (truth_.t - centre)};
  EXPECT_NEAR(align(imageOf(truth_), keyframeAt(beside), truth_).beside_rad, 6 * kDegree,
              0.2 * kDegree);
}

TEST_F(KeyframeAlignerOnScene, NeverExplainsLessThanItsStart) {
  // Far away, coarse levels have few points and lead astray.
  KeyframeAlignmentSettings start_alone;
  start_alone.coarsest_level = 0;
  start_alone.max_evaluations = 1;
  for (const double distance : {3.0, 6.0, 12.0}) {
    for (int side = 0; side < 6; ++side) {
      SCOPED_TRACE(testing::Message() << distance << " diameters away, side " << side);
      const Pose truth = cameraAround(*scene_, side, 0.3, distance);
      const KeyframePoints keyframe = keyframeAt(truth);
      const auto aligner = makeCpuKeyframeAligner(1, "auto");
      aligner->observe(observed(imageOf(truth)), frameWindowFor(keyframe, kCamera, truth));
      const int number = aligner->add(std::make_shared<const KeyframePoints>(keyframe));
      const Hypothesis start = aligner->align({{number, truth}}, start_alone, {}).front();
      const Hypothesis found = aligner->align({{number, truth}}, {}, {}).front();
      // Each in the light that it found: at the pose itself that is a little better known.
      EXPECT_LE(found.loss, 1.1 * start.loss);
    }
  }
}

TEST_F(KeyframeAlignerOnScene, IgnoresTheLight) {
  // Not wholly: what is nearly flat is compared with a fixed contrast.
  expectFoundFromAround(imageOf(truth_, {0.7f, 0.9f, 1.1f}, -0.05f), 5, 0.32, 0.012);
}

TEST_F(KeyframeAlignerOnScene, IgnoresWhereTheLightComesFrom) {
  const Eigen::Vector3f change = {0.7f, -0.5f, 0.4f};
  const Image lit = imageInLight(truth_, change);
  expectFoundFromAround(lit, 5, 0.3, 0.009);
  const Hypothesis found = align(lit, keyframeAt(truth_), truth_);
  const Hypothesis learned = align(imageOf(truth_), keyframeAt(truth_), truth_);
  EXPECT_GT(found.score, learned.score - 0.05);
}

TEST_F(KeyframeAlignerOnScene, IgnoresAnOccluder) {
  const KeyframePoints keyframe = keyframeAt(offBy(truth_, {0.6, 0.5, -0.6}, 6));
  const Hypothesis hidden =
      align(covered(imageOf(truth_)), keyframe, offBy(truth_, {0.5, -0.5, 0.5}, 4));
  expectFound(hidden, 0.45, 0.01);
  const Hypothesis free = align(imageOf(truth_), keyframe, offBy(truth_, {0.5, -0.5, 0.5}, 4));
  EXPECT_LT(hidden.visible_fraction, free.visible_fraction - 0.05);
}

TEST_F(KeyframeAlignerOnScene, StandsNoise) {
  Image image = imageOf(truth_);
  std::mt19937 random(3);
  std::normal_distribution<float> noise(0, 0.03f);
  for (float& value : image.values) value += noise(random);
  expectFoundFromAround(image, 4, 0.4, 0.008);
}

TEST_F(KeyframeAlignerOnScene, SaysHowFarOffNoiseMayLead) {
  // A pose's squared error by its own covariance has a mean of 6, were noise all. It is more: noise
  // takes contrast from what is nearly flat, in the whole image alike.
  constexpr int kImages = 24;
  const KeyframePoints keyframe = keyframeAt(truth_);
  const Image clean = imageOf(truth_);
  const Hypothesis exact = align(clean, keyframe, truth_);
  std::mt19937 random(5);
  std::normal_distribution<float> noise(0, 0.01f);
  double sum = 0;
  for (int i = 0; i < kImages; ++i) {
    Image image = clean;
    for (float& value : image.values) value += noise(random);
    const Hypothesis found = align(image, keyframe, truth_);
    EXPECT_GT(found.residual_variance, exact.residual_variance);
    const Eigen::Matrix3d turn = found.T_O_C.R * exact.T_O_C.R.transpose();
    Eigen::Matrix<double, 6, 1> x;
    x << found.T_O_C.t - object().centre - turn * (exact.T_O_C.t - object().centre), logSO3(turn);
    const Eigen::Matrix<double, 6, 1> g = found.information * x;
    sum += g.dot(found.gradient_scatter.inverse() * g);
  }
  EXPECT_GT(sum / kImages, 2);
  EXPECT_LT(sum / kImages, 18);
}

TEST_F(KeyframeAlignerOnScene, ARenewedKeyframeMakesNoJump) {
  const Image image = imageOf(truth_);
  const Pose before = align(image, keyframeAt(offBy(truth_, {0.7, 0.7, 0}, 10)), truth_).T_O_C;
  const Pose after = align(image, keyframeAt(before), before).T_O_C;
  const PoseError jump = poseError(before, after, object().centre, kCamera);
  EXPECT_LT(jump.rotation_rad / kDegree, 0.15);
  EXPECT_LT(jump.object_offset / object().diameter, 0.002);
}

TEST_F(KeyframeAlignerOnScene, FindsWhatLeavesTheImage) {
  // A third of the object is outside.
  const Pose beside(truth_.R, truth_.t + truth_.R * Eigen::Vector3d(0.85, 0, 0));
  truth_ = beside;
  const KeyframePoints keyframe = keyframeAt(truth_);
  const Hypothesis found = align(imageOf(truth_), keyframe, offBy(truth_, {0.6, -0.6, 0.6}, 3));
  expectFound(found, 0.3, 0.006);
}

TEST_F(KeyframeAlignerOnScene, SaysWhatCannotBeFound) {
  const KeyframePoints keyframe = keyframeAt(truth_);
  const Image image = imageOf(truth_);
  const Pose outside(truth_.R, truth_.t + truth_.R * Eigen::Vector3d(5, 0, 0));
  EXPECT_EQ(align(image, keyframe, outside).state, HypothesisState::kOutOfImage);
  const Pose behind(truth_.R, truth_.t + truth_.R * Eigen::Vector3d(0, 0, 6));
  EXPECT_EQ(align(image, keyframe, behind).state, HypothesisState::kBehindCamera);
  EXPECT_EQ(align(image, keyframe, truth_).state, HypothesisState::kLive);
}

TEST_F(KeyframeAlignerOnScene, ScoresRightPosesAboveWrongOnes) {
  const KeyframePoints keyframe = keyframeAt(truth_);
  const Pose other = cameraAround(*scene_, 2.6, -0.4);
  EXPECT_GT(align(imageOf(truth_), keyframe, truth_).score, 0.8);
  EXPECT_LT(align(imageOf(other), keyframe, truth_).score, 0.4);
}

TEST_F(KeyframeAlignerOnScene, SameInputSameBits) {
  const Image image = imageOf(truth_);
  const Pose start = offBy(truth_, {0.5, -0.5, 0.5}, 4);
  const KeyframePoints one =
      renderKeyframe(*makeAnalyticScene(1, cpuProcessor(1)), {kCamera, truth_});
  const KeyframePoints two =
      renderKeyframe(*makeAnalyticScene(1, cpuProcessor(2)), {kCamera, truth_});
  const Hypothesis a = align(image, one, start), b = align(image, two, start);
  EXPECT_EQ(a.T_O_C.R, b.T_O_C.R);
  EXPECT_EQ(a.T_O_C.t, b.T_O_C.t);
  EXPECT_EQ(a.information, b.information);
}

TEST_F(KeyframeAlignerOnScene, InstructionSetsAgree) {
  const Image image = imageOf(truth_);
  const KeyframePoints keyframe = keyframeAt(truth_);
  const Pose start = offBy(truth_, {0.5, -0.5, 0.5}, 4);
  const Pose any = align(image, keyframe, start, "baseline").T_O_C;
  const Pose best = align(image, keyframe, start).T_O_C;
  // Sums are rounded in another order; poses stop within a fiftieth of a pixel of each other.
  EXPECT_LT(rotationDistance(any.R, best.R) / kDegree, 0.01);
  EXPECT_LT((any.t - best.t).norm() / object().diameter, 1e-3);
}

TEST_F(KeyframeAlignerOnScene, LeavesOutWhatHasNoWeight) {
  // A gripper of strong colours before a quarter of the object: without its pixels nothing is
  // wrong.
  const Observation observation = withoutCovered(covered(imageOf(truth_)));
  const auto keyframe = std::make_shared<const KeyframePoints>(keyframeAt(truth_));
  const auto aligner = makeCpuKeyframeAligner(1);
  aligner->observe(observation, frameWindowFor(*keyframe, kCamera, truth_));
  const int number = aligner->add(keyframe);
  const Pose start = offBy(truth_, {0.5, -0.5, 0.5}, 3);
  const Hypothesis found = aligner->align({{number, start}}, {}, {}).front();
  expectFound(found, 0.1, 0.003);
  EXPECT_GT(found.visible_fraction, 0.9);
}

TEST_F(KeyframeAlignerOnScene, BytesAreAsTheirValues) {
  const Image8 bytes = toBytes(imageOf(truth_));
  const auto found_in = [&](const Observation& observation) {
    const auto keyframe = std::make_shared<const KeyframePoints>(keyframeAt(truth_));
    const auto aligner = makeCpuKeyframeAligner(1);
    aligner->observe(observation, frameWindowFor(*keyframe, kCamera, truth_));
    const int number = aligner->add(keyframe);
    return aligner->align({{number, offBy(truth_, {0.5, -0.5, 0.5}, 3)}}, {}, {}).front();
  };
  const Hypothesis of_bytes = found_in(observe(bytes, kCamera));
  const Hypothesis of_values = found_in(observed(toFloat(bytes)));
  EXPECT_EQ(of_bytes.T_O_C.t, of_values.T_O_C.t);
  EXPECT_EQ(of_bytes.T_O_C.R, of_values.T_O_C.R);
  EXPECT_EQ(of_bytes.loss, of_values.loss);
}

TEST_F(KeyframeAlignerOnScene, ManyStartsAreAsOneByOne) {
  const auto keyframe = std::make_shared<const KeyframePoints>(keyframeAt(truth_));
  const auto other =
      std::make_shared<const KeyframePoints>(keyframeAt(offBy(truth_, {0.6, 0.5, -0.6}, 6)));
  const auto aligner = makeCpuKeyframeAligner(2);
  aligner->observe(observed(imageOf(truth_)), frameWindowFor(*keyframe, kCamera, truth_));
  const int a = aligner->add(keyframe), b = aligner->add(other);
  std::vector<KeyframeStart> starts;
  for (int i = 0; i < 8; ++i) {
    starts.push_back({i % 2 ? a : b, offBy(truth_, Eigen::Vector3d::Unit(i % 3), i - 4)});
  }
  const std::vector<Hypothesis> together = aligner->align(starts, {}, {});
  ASSERT_EQ(together.size(), starts.size());
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const Hypothesis alone = aligner->align({starts[i]}, {}, {}).front();
    EXPECT_EQ(alone.T_O_C.R, together[i].T_O_C.R);
    EXPECT_EQ(alone.T_O_C.t, together[i].T_O_C.t);
  }
}

TEST_F(KeyframeAlignerOnScene, FindsAnObjectThatHasComeNear) {
  // Twice as large in the image as in the keyframe: the frame's coarser levels are compared.
  const KeyframePoints far =
      keyframeAt({truth_.R, object().centre + 2 * (truth_.t - object().centre)});
  expectFound(align(imageOf(truth_), far, offBy(truth_, {0.5, -0.5, 0.5}, 3)), 0.3, 0.01);
}

TEST_F(KeyframeAlignerOnScene, CanBeCancelled) {
  const auto keyframe = std::make_shared<const KeyframePoints>(keyframeAt(truth_));
  const auto aligner = makeCpuKeyframeAligner(1);
  aligner->observe(observed(imageOf(truth_)), frameWindowFor(*keyframe, kCamera, truth_));
  const int number = aligner->add(keyframe);
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(aligner->align({{number, truth_}}, {}, cancellation), Cancelled);
}

TEST_F(KeyframeAlignerOnScene, RefusesAnImageThatIsTooSmall) {
  Observation tiny;
  tiny.camera = {8, 8, 10, 10, 3.5, 3.5};
  tiny.image = Image(8, 8, 3);
  const auto aligner = makeCpuKeyframeAligner(1);
  EXPECT_THROW(aligner->observe(tiny, {{0, 0, 8, 8}, 0, 4}), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
