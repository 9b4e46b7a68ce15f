// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Cholesky>

#include <cmath>
#include <limits>
#include <vector>

#include "backend/hypotheses.h"
#include "backend/loaded_field.h"
#include "backend/plans.h"
#include "field/field.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "support/expect_error.h"

// Direct alignment of single hypotheses on one level.

namespace nerf_pose_refiner {
namespace {

const Camera kCamera = {240, 200, 330, 330, 119.5, 99.5};

/// The scene, an image of it and the pose that it was taken from.
struct Setting {
  std::shared_ptr<const LoadedField> scene;
  Pose truth;
  Observation observation;
  ImageLevel level = {kCamera.resized(120, 100), 1.0};
  AlignStage stage;

  explicit Setting(int threads = 1)
      : scene(makeAnalyticScene(1, cpuProcessor(threads))),
        truth(cameraAround(*scene, 0.6, 0.4)),
        observation(observeScene(*scene, kCamera, truth)) {
    stage.max_iterations = 20;
    stage.rays_per_side = 4;
  }

  Eigen::Vector3d centre() const { return scene->field().metadata.centre; }

  /// The camera moved by v [diameters] and turned by w [rad] about the object.
  Pose moved(const Eigen::Vector3d& v, const Eigen::Vector3d& w) const {
    const Eigen::Matrix3d turn = expSO3(w);
    return {turn * truth.R, centre() + v + turn * (truth.t - centre())};
  }

  Hypothesis alignFrom(const Pose& start, const CancellationToken& cancellation = {}) {
    const auto solver = scene->makeSolver(observation, {level}, 1);
    SamplingPlan sampling;
    sampling.count = 1;
    solver->sample({start}, sampling);
    solver->align(0, stage, cancellation);
    return solver->readHypotheses().front();
  }
};

// To 0.05 px of the level at the rim, times `slack`.
void expectFound(const Setting& setting, const Hypothesis& found, double slack = 1) {
  ASSERT_EQ(found.state, HypothesisState::kLive);
  EXPECT_LT(rotationDistance(found.T_O_C.R, setting.truth.R), slack * 1.5e-3);
  const Eigen::Vector3d offset =
      found.T_O_C.inverse() * setting.centre() - setting.truth.inverse() * setting.centre();
  EXPECT_LT(offset.head<2>().norm(), slack * 1e-3);
  EXPECT_LT(std::abs(offset.z()), slack * 4e-3);
}

TEST(Align, perfectStartStays) {
  Setting setting;
  expectFound(setting, setting.alignFrom(setting.truth));
}

TEST(Align, offAlongX) {
  Setting setting;
  expectFound(setting, setting.alignFrom(setting.moved({0.08, 0, 0}, {0, 0, 0})));
}

TEST(Align, offAlongZ) {
  Setting setting;
  expectFound(setting, setting.alignFrom(setting.moved({0, 0, 0.08}, {0, 0, 0})));
}

TEST(Align, rotated) {
  Setting setting;
  expectFound(setting, setting.alignFrom(setting.moved({0, 0, 0}, {0.05, -0.08, 0.06})));
}

TEST(Align, offAndRotated) {
  Setting setting;
  expectFound(setting, setting.alignFrom(setting.moved({0.05, -0.06, 0.04}, {-0.06, 0.05, 0.07})));
}

TEST(Align, beforeAKnownColour) {
  Setting setting;
  setting.observation.background = Background::kKnownColour;
  setting.observation.background_colour = Eigen::Vector3f(1, 0.5f, 0.25f);
  for (std::size_t i = 0; i < setting.observation.image.values.size(); ++i) {
    const float empty = 1 - setting.observation.alpha.values[i / 3];
    setting.observation.image.values[i] +=
        empty * setting.observation.background_colour[static_cast<int>(i % 3)];
  }
  expectFound(setting, setting.alignFrom(setting.moved({0.05, -0.06, 0.04}, {-0.06, 0.05, 0.07})));
}

// Colours tell object and background apart only so well: to 0.15 px.
constexpr double kUnknownSlack = 3;

// The background has other colours than the object, and a pattern that could mislead.
Observation beforePattern(const Observation& observation) {
  Observation seen = observation;
  seen.background = Background::kUnknown;
  seen.alpha = Image();
  for (int y = 0; y < seen.image.height; ++y) {
    for (int x = 0; x < seen.image.width; ++x) {
      const float empty = 1 - observation.alpha.at(x, y, 0);
      const float wave = 0.1f * std::sin(0.2f * static_cast<float>(x + y));
      seen.image.at(x, y, 0) += empty * (0.15f + wave);
      seen.image.at(x, y, 1) += empty * (0.9f - wave);
      seen.image.at(x, y, 2) += empty * (0.2f + wave);
    }
  }
  return seen;
}

TEST(Align, beforeAnUnknownBackground) {
  Setting setting;
  setting.observation = beforePattern(setting.observation);
  setting.stage.fit_gain_bias = true;
  setting.stage.alpha_weight = 0.03;
  expectFound(setting, setting.alignFrom(setting.moved({0.03, -0.04, 0.03}, {-0.04, 0.03, 0.05})),
              kUnknownSlack);
}

TEST(Align, inAnotherLightBeforeAnUnknownBackground) {
  Setting setting;
  const float gain[3] = {0.8f, 1.1f, 0.9f};
  for (std::size_t i = 0; i < setting.observation.image.values.size(); ++i) {
    setting.observation.image.values[i] *= gain[i % 3];
  }
  setting.observation = beforePattern(setting.observation);
  setting.stage.fit_gain_bias = true;
  setting.stage.alpha_weight = 0.03;
  expectFound(setting, setting.alignFrom(setting.moved({0.03, -0.04, 0.03}, {-0.04, 0.03, 0.05})),
              kUnknownSlack);
}

// A grey square over a corner of the object, and pixels that are said to be somebody else's.
TEST(Align, behindAMaskedGripper) {
  Setting setting;
  setting.observation.weight = Image(kCamera.width, kCamera.height, 1, 1.0f);
  for (int y = 60; y < 110; ++y) {
    for (int x = 80; x < 120; ++x) {
      for (int c = 0; c < 3; ++c) setting.observation.image.at(x, y, c) = 0.5f;
      setting.observation.alpha.at(x, y, 0) = 0;
      setting.observation.weight.at(x, y, 0) = 0;
    }
  }
  expectFound(setting, setting.alignFrom(setting.moved({0.03, -0.04, 0.03}, {-0.04, 0.03, 0.05})));
}

// Before an unknown background, too: what the gripper looks like changes not one bit.
TEST(Align, behindAMaskedGripperBeforeAnUnknownBackground) {
  for (const bool compare_contrast : {false, true}) {
    std::vector<Hypothesis> found;
    for (const float paint : {0.0f, 1.0f}) {
      Setting setting;
      setting.observation = beforePattern(setting.observation);
      setting.stage.fit_gain_bias = true;
      setting.stage.alpha_weight = 0.03;
      setting.stage.compare_contrast = compare_contrast;
      setting.observation.weight = Image(kCamera.width, kCamera.height, 1, 1.0f);
      for (int y = 60; y < 110; ++y) {
        for (int x = 80; x < 120; ++x) {
          for (int c = 0; c < 3; ++c) setting.observation.image.at(x, y, c) = paint;
          setting.observation.weight.at(x, y, 0) = 0;
        }
      }
      found.push_back(setting.alignFrom(setting.moved({0.03, -0.04, 0.03}, {-0.04, 0.03, 0.05})));
      expectFound(setting, found.back(), 4);  // a part of the object is not seen
    }
    EXPECT_EQ(found[0].T_O_C.t, found[1].T_O_C.t) << compare_contrast;
    EXPECT_EQ(found[0].T_O_C.R, found[1].T_O_C.R) << compare_contrast;
    EXPECT_EQ(found[0].loss, found[1].loss) << compare_contrast;
  }
}

TEST(Align, informationAndVarianceAreReported) {
  Setting setting;
  const Hypothesis found = setting.alignFrom(setting.truth);
  EXPECT_TRUE(found.information.isApprox(found.information.transpose()));
  EXPECT_GT(found.information.ldlt().vectorD().minCoeff(), 0);
  EXPECT_GT(found.visible_fraction, 0.95);
  EXPECT_GT(found.iterations, 0);
}

TEST(Align, flagsBehindTheCamera) {
  Setting setting;
  Pose away = setting.truth;
  away.R = away.R * expSO3({0, M_PI, 0});
  EXPECT_EQ(setting.alignFrom(away).state, HypothesisState::kBehindCamera);
}

TEST(Align, flagsOutOfTheImage) {
  Setting setting;
  Pose aside = setting.truth;
  aside.R = aside.R * expSO3({0, 0.6, 0});
  EXPECT_EQ(setting.alignFrom(aside).state, HypothesisState::kOutOfImage);
}

TEST(Align, flagsNotFinite) {
  Setting setting;
  Pose broken = setting.truth;
  broken.t.x() = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(setting.alignFrom(broken).state, HypothesisState::kNotFinite);
}

TEST(Align, sameBitsForAnyNumberOfThreads) {
  Setting one(1), two(2);
  const Pose start = one.moved({0.05, -0.06, 0.04}, {-0.06, 0.05, 0.07});
  const Hypothesis a = one.alignFrom(start), b = two.alignFrom(start);
  EXPECT_EQ(a.T_O_C.R, b.T_O_C.R);
  EXPECT_EQ(a.T_O_C.t, b.T_O_C.t);
  EXPECT_EQ(a.loss, b.loss);
  EXPECT_EQ(a.information, b.information);
}

TEST(Align, stops) {
  Setting setting;
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(setting.alignFrom(setting.truth, cancellation), Cancelled);
}

TEST(Align, wrongLevelIsNamed) {
  Setting setting;
  const auto solver = setting.scene->makeSolver(setting.observation, {setting.level}, 1);
  expectError<std::invalid_argument>([&] { solver->align(1, setting.stage, {}); }, "level 1");
}

// Loss of poses on the same level, each scored alone and as the table has them.
std::vector<double> scores(Setting* setting, const std::vector<Pose>& poses) {
  std::vector<double> losses;
  for (const Pose& pose : poses) {
    AlignStage still = setting->stage;
    std::swap(still, setting->stage);
    setting->stage.max_iterations = 0;
    losses.push_back(setting->alignFrom(pose).loss);
    std::swap(still, setting->stage);
  }
  return losses;
}

// A pose that shows only a little of the object, which agrees where it does, is worse than one
// that shows all of it and is a little off: all are judged on the same pixels.
TEST(Score, leavingTheImageDoesNotPay) {
  Setting setting;
  const Pose near_by = setting.moved({0.01, 0, 0}, {0, 0.01, 0});
  Pose leaving = setting.truth;
  leaving.R = leaving.R * expSO3({0, 0.34, 0});
  for (const bool known : {true, false}) {
    if (!known) setting.observation = beforePattern(setting.observation);
    const std::vector<double> loss = scores(&setting, {setting.truth, near_by, leaving});
    EXPECT_LT(loss[0], loss[1]);
    EXPECT_LT(loss[1], loss[2]);
  }
}

// Further away, so smaller: what it no longer covers counts.
TEST(Score, shrinkingDoesNotPay) {
  Setting setting;
  const Pose far = {setting.truth.R, setting.centre() + 1.3 * (setting.truth.t - setting.centre())};
  const Pose near_by = {setting.truth.R,
                        setting.centre() + 1.02 * (setting.truth.t - setting.centre())};
  for (const bool known : {true, false}) {
    if (!known) setting.observation = beforePattern(setting.observation);
    const std::vector<double> loss = scores(&setting, {setting.truth, near_by, far});
    EXPECT_LT(loss[0], loss[1]);
    EXPECT_LT(loss[1], loss[2]);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
