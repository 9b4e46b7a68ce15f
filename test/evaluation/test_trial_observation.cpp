// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/trial_observation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kSize = 160;

/// A view of a square of one colour, opaque, in an image that is transparent elsewhere.
PosedView squareView(int r, int g, int b) {
  Image8 rgba(kSize, kSize, 4);
  for (int y = 40; y < 120; ++y) {
    for (int x = 40; x < 120; ++x) {
      const int colour[4] = {r, g, b, 255};
      for (int c = 0; c < 4; ++c) rgba.at(x, y, c) = static_cast<std::uint8_t>(colour[c]);
    }
  }
  PosedView view;
  view.rgba = std::make_shared<const Image8>(rgba);
  view.camera = {kSize, kSize, 200, 200, 79.5, 79.5};
  return view;
}

/// Mean and variance of a channel inside the square.
std::pair<double, double> momentsOf(const Image& image, int channel) {
  double sum = 0, squares = 0;
  int count = 0;
  for (int y = 50; y < 110; ++y) {
    for (int x = 50; x < 110; ++x, ++count) {
      sum += image.at(x, y, channel);
      squares += image.at(x, y, channel) * image.at(x, y, channel);
    }
  }
  const double mean = sum / count;
  return {mean, squares / count - mean * mean};
}

Observation observed(const std::string& condition, const PosedView& view, int index = 0) {
  return TrialObservation::named(condition, "alpha").of(view, index);
}

TEST(TrialObservation, cleanIsTheViewWithItsAlpha) {
  const Observation o = observed("clean", squareView(51, 102, 204));
  EXPECT_EQ(o.background, Background::kKnownAlpha);
  EXPECT_NEAR(o.image.at(80, 80, 1), 0.4, 1e-6);
  EXPECT_EQ(o.image.at(10, 10, 1), 0);
  EXPECT_EQ(o.alpha.at(80, 80, 0), 1);
  o.validate();
}

// HSV's value goes from 0.8 to 1.0: all channels by a quarter. The background stays black.
TEST(TrialObservation, brightnessByHand) {
  const Observation o = observed("brightness", squareView(51, 102, 204));
  EXPECT_NEAR(o.image.at(80, 80, 0), 0.25, 1e-6);
  EXPECT_NEAR(o.image.at(80, 80, 1), 0.5, 1e-6);
  EXPECT_NEAR(o.image.at(80, 80, 2), 1, 1e-6);
  EXPECT_EQ(o.image.at(10, 10, 0), 0);
}

TEST(TrialObservation, noiseHasTheMomentsThatItSays) {
  const PosedView view = squareView(128, 20, 128);
  const auto gaussian = momentsOf(observed("gaussian", view).image, 0);
  EXPECT_NEAR(gaussian.first, 128 / 255.0, 0.001);
  EXPECT_NEAR(std::sqrt(gaussian.second), 0.01, 0.0005);
  // Poisson: the variance of the 8-bit value is its mean, of a large and of a small one.
  const Image poisson = observed("poisson", view).image;
  for (const int channel : {0, 1}) {
    const double value = channel == 0 ? 128 : 20;
    const auto moments = momentsOf(poisson, channel);
    EXPECT_NEAR(255 * moments.first, value, 0.04 * value);
    EXPECT_NEAR(255 * 255 * moments.second, value, 0.1 * value);
  }
}

TEST(TrialObservation, discsAreMissingAtTheSilhouettesEdge) {
  const Observation o = observed("discs", squareView(200, 200, 200));
  int missing = 0, changed_outside = 0;
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x < kSize; ++x) {
      const bool inside = x >= 40 && x < 120 && y >= 40 && y < 120;
      missing += inside && o.alpha.at(x, y, 0) == 0 && o.image.at(x, y, 0) == 0;
      changed_outside += !inside && o.alpha.at(x, y, 0) != 0;
    }
  }
  // Half a disc of a sixteenth of the image, once or five times.
  const double half_disc = 0.5 * M_PI * 10 * 10;
  EXPECT_GT(missing, 0.9 * half_disc);
  EXPECT_LT(missing, 5 * 1.2 * half_disc);
  EXPECT_EQ(changed_outside, 0);
}

TEST(TrialObservation, motionAndDefocusBlurKeepTheLight) {
  const PosedView view = squareView(200, 100, 50);
  for (const char* condition : {"motion_blur", "defocus"}) {
    TrialObservation how = TrialObservation::named(condition, "alpha");
    how.background = "alpha";  // on black
    const Observation sharp = observed("clean", view), blurred = how.of(view, 3);
    double before = 0, after = 0, steepest = 0;
    for (float value : sharp.image.values) before += value;
    for (float value : blurred.image.values) after += value;
    for (int x = 1; x < kSize; ++x) {
      steepest = std::max<double>(
          steepest, std::abs(blurred.image.at(x, 80, 0) - blurred.image.at(x - 1, 80, 0)));
    }
    EXPECT_NEAR(after, before, 1e-3 * before) << condition;
    EXPECT_LT(steepest, 0.99 * 200 / 255) << condition;
  }
}

TEST(TrialObservation, theFocalLengthIsSaidWrong) {
  EXPECT_NEAR(observed("focal", squareView(1, 2, 3)).camera.fx, 202, 1e-9);
}

// A photo with a mask is shown as it is, the background included.
TEST(TrialObservation, saysHowMuchOfAnInstanceIsVisible) {
  const std::vector<PosedView> views(8, squareView(51, 102, 204));
  const TrialObservation robot = TrialObservation::named("placed_robot", "alpha");
  const TrialObservation hidden = TrialObservation::named("hidden", "alpha");
  double least = 1, most = 0;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const TrialImage quarter = robot.imageOf(views, i), drawn = hidden.imageOf(views, i);
    ASSERT_EQ(quarter.instances.size(), 1u);
    EXPECT_NEAR(quarter.instances[0].visible, 0.75, 0.02);
    least = std::min(least, drawn.instances.at(0).visible);
    most = std::max(most, drawn.instances.at(0).visible);
  }
  EXPECT_GE(least, 0.38);
  EXPECT_LT(least, 0.7);
  EXPECT_GT(most, 0.75);
}

TEST(TrialObservation, otherColoursAreAnotherObject) {
  const std::vector<PosedView> views = {squareView(51, 102, 204)};
  const TrialImage other = TrialObservation::named("recoloured", "alpha").imageOf(views, 0);
  EXPECT_TRUE(other.instances.empty());
  const Eigen::Vector2d middle = other.view.camera.project({0, 0, 1});
  const int x = static_cast<int>(middle.x()), y = static_cast<int>(middle.y());
  EXPECT_NEAR(other.observation.image.at(x, y, 0), 204 / 255.0, 0.01);
  EXPECT_NEAR(other.observation.image.at(x, y, 1), 51 / 255.0, 0.01);
  EXPECT_NEAR(other.observation.image.at(x, y, 2), 102 / 255.0, 0.01);
}

TEST(TrialObservation, aGroupShowsSeveralInstances) {
  const std::vector<PosedView> views(3, squareView(51, 102, 204));
  const TrialImage group = TrialObservation::named("group", "alpha").imageOf(views, 1);
  EXPECT_GE(group.instances.size(), 2u);
  EXPECT_EQ(group.observation.image.width, 640);
  EXPECT_TRUE(TrialObservation::named("absent", "alpha").imageOf(views, 1).instances.empty());
}

TEST(TrialObservation, aTurnedObjectIsAsLargeAsItsConditionSays) {
  const std::vector<PosedView> views = {squareView(51, 102, 204)};
  for (const auto& [condition, least, most] :
       {std::tuple("turned", 0.2, 0.5), std::tuple("small", 0.125, 0.2)}) {
    for (std::uint64_t seed = 1; seed < 6; ++seed) {
      TrialObservation how = TrialObservation::named(condition, "alpha");
      how.seed = seed;
      const TrialImage image = how.imageOf(views, 0);
      ASSERT_EQ(image.instances.size(), 1u);
      const double width = silhouetteBox(image.view).sizes().maxCoeff() / 640;
      EXPECT_GT(width, least - 0.01) << condition;
      EXPECT_LT(width, most + 0.01) << condition;
      EXPECT_EQ(image.instances.front().T_O_C.R, image.view.T_O_C.R);
    }
  }
}

TEST(TrialObservation, ownPhotoKeepsItsBackground) {
  PosedView view = squareView(51, 51, 51);
  Image8 photo = *view.rgba;
  photo.at(10, 10, 0) = 255;
  view.rgba = std::make_shared<const Image8>(photo);
  const Observation o = TrialObservation::named("clean", "own").of(view, 0);
  EXPECT_EQ(o.background, Background::kMask);
  EXPECT_EQ(o.image.at(10, 10, 0), 1);
  EXPECT_EQ(o.alpha.at(10, 10, 0), 0);
}

TEST(TrialObservation, theSameForTheSameSeedAndIndex) {
  const PosedView view = squareView(100, 150, 200);
  const Image a = observed("paper_noise", view, 2).image,
              b = observed("paper_noise", view, 2).image;
  EXPECT_EQ(a.values, b.values);
  EXPECT_NE(a.values, observed("paper_noise", view, 3).image.values);
  expectError<std::invalid_argument>([&] { observed("fog", view); }, "no condition 'fog'");
}

}  // namespace
}  // namespace nerf_pose_refiner
