// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/view_selection.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "math/angle.h"
#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

const Eigen::Vector3d kCentre(0.1, 0.2, 0.3);

/// A camera at a distance from the centre, `degrees` from +x towards +y.
Pose cameraAt(double degrees, double distance = 1) {
  const double angle = degrees * kDegree;
  Pose T_O_C;
  T_O_C.t = kCentre + distance * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0);
  return T_O_C;
}

/// Sharpness is 100 in the recent images.
ViewSelection selectionAfterSharpImages(int kept_views = 0) {
  ViewSelectionSettings settings;
  settings.min_angle_deg = 10;
  settings.min_distance = 0.2;
  settings.recent_images = 5;
  ViewSelection selection(settings, kCentre);
  for (int i = 0; i < 4; ++i) selection.judge(cameraAt(0), 100);
  for (int i = 0; i < kept_views; ++i) selection.keep(cameraAt(20.0 * i));
  return selection;
}

TEST(ViewSelection, WantsTurnOrDistance) {
  ViewSelection selection = selectionAfterSharpImages(2);  // at 0 and 20 degrees
  EXPECT_EQ(selection.kept(), 2);
  EXPECT_EQ(selection.judge(cameraAt(28), 100), ViewDecision::kTooNear);
  EXPECT_EQ(selection.judge(cameraAt(31), 100), ViewDecision::kKeep);
  EXPECT_EQ(selection.judge(cameraAt(-9), 100), ViewDecision::kTooNear);
  EXPECT_EQ(selection.judge(cameraAt(0, 1.21), 100), ViewDecision::kKeep);
}

TEST(ViewSelection, IsComparedWithAllKeptViews) {
  ViewSelection selection = selectionAfterSharpImages(5);
  EXPECT_EQ(selection.judge(cameraAt(1), 100), ViewDecision::kTooNear);  // as the first
}

TEST(ViewSelection, LeavesOutBlurredImages) {
  ViewSelection selection = selectionAfterSharpImages();
  EXPECT_EQ(selection.judge(cameraAt(0), 69), ViewDecision::kBlurred);
  EXPECT_EQ(selection.judge(cameraAt(0), 71), ViewDecision::kKeep);
}

TEST(ViewSelection, WaitsForImagesToCompareWith) {
  ViewSelectionSettings settings;
  settings.recent_images = 3;
  ViewSelection selection(settings, kCentre);
  EXPECT_EQ(selection.judge(cameraAt(0), 100), ViewDecision::kBlurred);
  EXPECT_EQ(selection.judge(cameraAt(0), 100), ViewDecision::kBlurred);
  EXPECT_EQ(selection.judge(cameraAt(0), 100), ViewDecision::kKeep);
}

// Where there is less texture all images are less sharp, and soon are the measure.
TEST(ViewSelection, FollowsTheScene) {
  ViewSelection selection = selectionAfterSharpImages();
  for (int i = 0; i < 3; ++i) selection.judge(cameraAt(0), 20);
  EXPECT_EQ(selection.judge(cameraAt(0), 20), ViewDecision::kKeep);
}

TEST(ViewSelection, RefusesSettingsThatMakeNoSense) {
  ViewSelectionSettings settings;
  settings.min_sharpness = 1.5;
  expectError<std::invalid_argument>([&] { ViewSelection(settings, kCentre); }, "min_sharpness");
}

TEST(Coverage, NamesWhatIsMissing) {
  Coverage coverage;
  EXPECT_EQ(coverage.missing().size(), 26u);
  EXPECT_EQ(coverage.fraction(), 0);
  // Within 35 degrees of +x: itself alone, for its neighbours are 45 degrees off.
  coverage.add({2, 0, 0});
  EXPECT_DOUBLE_EQ(coverage.fraction(), 1.0 / 26);
  // Between +x and +x+y.
  coverage.add({std::cos(22.5 * kDegree), std::sin(22.5 * kDegree), 0});
  EXPECT_DOUBLE_EQ(coverage.fraction(), 2.0 / 26);
  EXPECT_FALSE(coverage.adds({1, 0.1, 0}));
  EXPECT_TRUE(coverage.adds({-1, 0, 0}));
  for (const std::string& name : coverage.missing()) {
    EXPECT_NE(name, "+x");
    EXPECT_NE(name, "+x+y");
  }
}

TEST(Coverage, ARingAndATopAreMoreThanHalf) {
  Coverage coverage;
  for (int i = 0; i < 24; ++i) {
    const double angle = 15 * i * kDegree;
    for (const double height : {0.2, 1.0}) coverage.add({std::cos(angle), std::sin(angle), height});
  }
  coverage.add({0, 0, 1});
  EXPECT_DOUBLE_EQ(coverage.fraction(), 17.0 / 26);
  const std::vector<std::string> missing = coverage.missing();
  EXPECT_EQ(missing.front(), "-x-y-z");
  for (const std::string& name : missing) EXPECT_NE(name.find("-z"), std::string::npos) << name;
}

TEST(Coverage, OneSideIsNot) {
  Coverage coverage;
  for (int i = -3; i <= 3; ++i) {
    for (int j = -3; j <= 3; ++j) coverage.add({1, 0.2 * i, 0.2 * j});
  }
  EXPECT_LT(coverage.fraction(), 0.4);
}

}  // namespace
}  // namespace nerf_pose_refiner
