// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>

#include "backend/common/blur_rules.h"
#include "backend/cpu/cpu_observation.h"
#include "backend/cpu/rendered_image.h"
#include "backend/loaded_field.h"
#include "image/filter.h"
#include "support/analytic_scene.h"
#include "support/expect_error.h"

// Observations as the levels of a plan see them.

namespace nerf_pose_refiner {
namespace {

const Camera kObservingCamera = {320, 240, 440, 440, 159.5, 119.5};

class EveryLevel : public ::testing::TestWithParam<int> {};

// At the true pose a level of the observation is the image that is rendered for it.
TEST_P(EveryLevel, rendersWhatIsObserved) {
  const auto scene = makeAnalyticScene();
  const Pose truth = cameraAround(*scene, -0.5, 0.3);
  const Observation observation = observeScene(*scene, kObservingCamera, truth);
  constexpr double kLevelBlurPx = 1.0;
  const Camera level = kObservingCamera.resized(kObservingCamera.width / GetParam(),
                                                kObservingCamera.height / GetParam());
  const CpuObservation observed = observe(observation, {{level, kLevelBlurPx}}, 1);

  constexpr int kRays = 6;
  Image image, scratch;
  renderImages(*scene, {{level, truth, kRays, &image}}, RenderOptions(), CancellationToken());
  blurImage(gaussianKernel(renderingBlur(kLevelBlurPx, kRays)), &image, &scratch);
  double squares = 0;
  for (int y = 0; y < level.height; ++y) {
    for (int x = 0; x < level.width; ++x) {
      for (int c = 0; c < 4; ++c) {
        const double r = image.at(x, y, c) - observed.level(0).blurred.at(x, y, c);
        squares += r * r;
      }
    }
  }
  const double psnr = -10 * std::log10(squares / (4.0 * level.width * level.height));
  EXPECT_GT(psnr, 45);
}

INSTANTIATE_TEST_SUITE_P(Shrunk, EveryLevel, ::testing::Values(1, 2, 4, 8));

Observation plainObservation() {
  Observation observation;
  observation.camera = {4, 2, 10, 10, 1.5, 0.5};
  observation.image = Image(4, 2, 3, 0.5f);
  observation.background = Background::kUnknown;
  return observation;
}

TEST(Observe, whatIsOutsideWeighsNothing) {
  const Camera wide = plainObservation().camera.cropped(-1, 0, 6, 2);
  const auto observed = observe(plainObservation(), {{wide, 0.5}}, 1);
  const ObservedLevel& level = observed.level(0);
  EXPECT_EQ(level.weight.at(0, 0, 0), 0);
  EXPECT_EQ(level.weight.at(1, 0, 0), 1);
  EXPECT_EQ(level.weight.at(4, 1, 0), 1);
  EXPECT_EQ(level.weight.at(5, 1, 0), 0);
  EXPECT_NEAR(level.blurred.at(1, 0, 0), 0.5, 1e-6);  // no darkness comes in from outside
}

TEST(Observe, ignoredPixelsDoNotBleed) {
  Observation observation = plainObservation();
  observation.weight = Image(4, 2, 1, 1.0f);
  observation.weight.at(2, 0, 0) = 0;
  observation.image.at(2, 0, 0) = 1;
  const CpuObservation observed = observe(observation, {{observation.camera, 1.0}}, 1);
  EXPECT_NEAR(observed.level(0).blurred.at(1, 0, 0), 0.5, 1e-6);
}

TEST(Observe, aMaskMultipliesTheImage) {
  Observation observation = plainObservation();
  observation.background = Background::kMask;
  observation.alpha = Image(4, 2, 1, 0.0f);
  observation.alpha.at(0, 0, 0) = 1;
  const CpuObservation observed = observe(observation, {{observation.camera, 0.5}}, 1);
  EXPECT_EQ(observed.level(0).image.at(0, 0, 1), 0.5f);
  EXPECT_EQ(observed.level(0).image.at(1, 0, 1), 0.0f);
}

TEST(Observe, faultsAreNamed) {
  const auto scene = makeAnalyticScene();
  const auto observe = [&](const Observation& o) { scene->makeSolver(o, {{o.camera, 1.0}}, 1); };
  Observation small = plainObservation();
  small.camera.width = 5;
  expectError<std::invalid_argument>([&] { observe(small); }, "image", "4 x 2 x 3", "5 x 2 x 3");
  Observation no_alpha = plainObservation();
  no_alpha.background = Background::kMask;
  expectError<std::invalid_argument>([&] { observe(no_alpha); }, "alpha");
  Observation broken = plainObservation();
  broken.image.values[5] = NAN;
  expectError<std::invalid_argument>([&] { observe(broken); }, "image", "nan");
  Observation burnt = plainObservation();
  burnt.image.values[5] = 1.5f;
  expectError<std::invalid_argument>([&] { observe(burnt); }, "image holds 1.5", "0..1");
  Observation negative = plainObservation();
  negative.weight = Image(4, 2, 1, -1.0f);
  expectError<std::invalid_argument>([&] { observe(negative); }, "weight holds -1");
  Observation bytes = plainObservation();
  bytes.background = Background::kMask;
  bytes.alpha = Image(4, 2, 1, 255.0f);
  expectError<std::invalid_argument>([&] { observe(bytes); }, "alpha holds 255");
  Observation coloured = plainObservation();
  coloured.background = Background::kKnownColour;
  coloured.background_colour = {0, NAN, 0};
  expectError<std::invalid_argument>([&] { observe(coloured); }, "background_colour");
}

}  // namespace
}  // namespace nerf_pose_refiner
