// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/view_bank.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

#include "backend/loaded_field.h"
#include "math/angle.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"

namespace nerf_pose_refiner {
namespace {

class ViewBankTest : public testing::Test {
 protected:
  const FieldMetadata& object() const { return scene_->field().metadata; }

  std::shared_ptr<const LoadedField> scene_ = makeAnalyticScene(1, cpuProcessor(2));
  ViewBank bank_{scene_, ViewBankSettings()};
};

TEST_F(ViewBankTest, SeesTheObjectFromAllAround) {
  // Wherever a camera is, some view is at most so far beside it.
  for (const double azimuth : {0.0, 1.0, 2.5, 4.0, 5.5}) {
    for (const double elevation : {-1.5, -0.8, 0.0, 0.7, 1.5}) {
      const Pose camera = cameraAround(*scene_, azimuth, elevation);
      const std::vector<int> around = bank_.around(camera, 13 * kDegree);
      ASSERT_FALSE(around.empty());
      const KeyframePoints& view = *bank_.view(around.front(), {});
      const Eigen::Vector3d a = (view.T_O_C.t - object().centre).normalized();
      const Eigen::Vector3d b = (camera.t - object().centre).normalized();
      EXPECT_LT(std::acos(a.dot(b)) / kDegree, 13) << azimuth << " " << elevation;
    }
  }
}

TEST_F(ViewBankTest, WiderIsMore) {
  const Pose camera = cameraAround(*scene_, 0.4, 0.3);
  const std::vector<int> narrow = bank_.around(camera, 20 * kDegree);
  const std::vector<int> wide = bank_.around(camera, 40 * kDegree);
  EXPECT_GT(wide.size(), 2 * narrow.size());
  const std::set<int> all(wide.begin(), wide.end());
  for (const int number : narrow) EXPECT_EQ(all.count(number), 1u);
  EXPECT_EQ(bank_.around(camera, 0).size(), 1u);  // the nearest at least
}

TEST_F(ViewBankTest, MakesAViewOnce) {
  EXPECT_EQ(bank_.memory_bytes(), 0u);
  const auto first = bank_.view(3, {});
  EXPECT_EQ(bank_.view(3, {}), first);
  EXPECT_GT(first->levels.front().point_count, 100);
  // All views together have 64 MiB.
  EXPECT_LT(bank_.memory_bytes() * ViewBankSettings().views, 64u << 20);
  EXPECT_THROW(bank_.view(-1, {}), std::out_of_range);
}

TEST_F(ViewBankTest, MakesSeveralAtOnce) {
  const auto third = bank_.view(3, {});
  bank_.make({2, 3, 5}, {});
  EXPECT_EQ(bank_.view(3, {}), third);  // it was there
  const std::size_t bytes = bank_.memory_bytes();
  EXPECT_GT(bytes, memoryBytes(*third));
  ViewBank other(scene_, ViewBankSettings());
  EXPECT_EQ(bank_.view(5, {})->levels[0].chosen.x, other.view(5, {})->levels[0].chosen.x);
  EXPECT_EQ(bank_.memory_bytes(), bytes);  // nothing was made again
}

TEST_F(ViewBankTest, IsSharedByThoseWhoWantTheSame) {
  const auto first = ViewBank::of(scene_, ViewBankSettings());
  EXPECT_EQ(ViewBank::of(scene_, ViewBankSettings()), first);
  ViewBankSettings grey, far;
  grey.keyframe.grey = true;
  far.distance = 5;
  EXPECT_NE(ViewBank::of(scene_, grey), first);
  EXPECT_NE(ViewBank::of(scene_, far), first);
  EXPECT_NE(ViewBank::of(makeAnalyticScene(1, cpuProcessor(1)), ViewBankSettings()), first);
}

TEST_F(ViewBankTest, IsGivenUpWithItsLastUser) {
  ViewBank::of(scene_, ViewBankSettings())->make({1}, {});
  EXPECT_EQ(ViewBank::of(scene_, ViewBankSettings())->made(), 0);
}

TEST_F(ViewBankTest, ThreadsGetTheSameViews) {
  std::vector<std::shared_ptr<const KeyframePoints>> one(8), other(8);
  const auto takeAll = [&](auto* views) {
    for (int number = 0; number < 8; ++number) (*views)[number] = bank_.view(number, {});
  };
  std::thread beside([&] { takeAll(&other); });
  takeAll(&one);
  beside.join();
  EXPECT_EQ(one, other);
  EXPECT_EQ(bank_.made(), 8);
}

TEST_F(ViewBankTest, CanBeCancelled) {
  CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(bank_.view(0, cancellation), Cancelled);
  EXPECT_NE(bank_.view(0, {}), nullptr);
}

TEST_F(ViewBankTest, RefusesSettingsOutOfRange) {
  ViewBankSettings settings;
  settings.distance = 0.4;
  EXPECT_THROW(ViewBank(scene_, settings), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
