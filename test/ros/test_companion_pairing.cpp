// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/companion_pairing.h"

#include <gtest/gtest.h>
#include <boost/make_shared.hpp>

#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "ros/conversions/lead_camera.h"

namespace nerf_pose_refiner {
namespace {

class CompanionPairingTest : public testing::Test {
 protected:
  static constexpr double kStart_s = 1000;

  static sensor_msgs::ImageConstPtr stamped(double seconds) {
    auto image = boost::make_shared<sensor_msgs::Image>();
    image->header.stamp = ros::Time(kStart_s + seconds);
    return image;
  }

  static CompanionPairing::Settings settings() { return {0.02, 1, 1, "depth image"}; }

  /// @param seconds stamp. @param now on the wall clock.
  void image(double seconds, double now, std::uint32_t clock_jumps = 0) {
    pairing_.add({stamped(seconds), nullptr, ros::WallTime(100 + now), clock_jumps},
                 ros::WallTime(100 + now));
  }
  void depth(double seconds, double now) {
    pairing_.addCompanion({stamped(seconds), nullptr}, ros::WallTime(100 + now));
  }
  void tick(double now) { pairing_.tick(ros::WallTime(100 + now)); }

  /// Stamps of the images that were passed on since the last call and of their depth [ms]; -1:
  /// none.
  std::vector<std::pair<int, int>> take() {
    const auto ms = [](const sensor_msgs::ImageConstPtr& image) {
      return image ? static_cast<int>(std::lround(1e3 * (image->header.stamp.toSec() - kStart_s)))
                   : -1;
    };
    std::vector<std::pair<int, int>> taken;
    for (const CameraFrame& frame : passed_) {
      taken.emplace_back(ms(frame.image), ms(frame.depth.image));
      EXPECT_EQ(frame.depth.image == nullptr, !frame.depth.why_none.empty());
    }
    last_reason_ = passed_.empty() ? "" : passed_.back().depth.why_none;
    passed_.clear();
    return taken;
  }

  using Pairs = std::vector<std::pair<int, int>>;
  std::vector<CameraFrame> passed_;
  std::string last_reason_;
  CompanionPairing pairing_{settings(), [](CameraFrame* frame) { return &frame->depth; },
                            [this](CameraFrame frame) { passed_.push_back(std::move(frame)); }};
};

TEST_F(CompanionPairingTest, AnImageWaitsForItsDepth) {
  image(0, 0);
  EXPECT_EQ(take(), Pairs());
  depth(0.01, 0.02);
  EXPECT_EQ(take(), (Pairs{{0, 10}}));
}

TEST_F(CompanionPairingTest, DepthMayComeFirst) {
  depth(0.1, 0);
  image(0.1, 0.01);
  EXPECT_EQ(take(), (Pairs{{100, 100}}));
}

TEST_F(CompanionPairingTest, TakesTheNearestOfSeveral) {
  depth(0.085, 0);
  depth(0.105, 0.01);
  depth(0.118, 0.02);
  image(0.1, 0.03);
  EXPECT_EQ(take(), (Pairs{{100, 105}}));
}

TEST_F(CompanionPairingTest, ANewerDepthEndsTheWait) {
  image(0, 0);
  depth(-0.05, 0.01);
  EXPECT_EQ(take(), Pairs());
  depth(0.05, 0.02);
  EXPECT_EQ(take(), (Pairs{{0, -1}}));
  EXPECT_EQ(last_reason_,
            "no depth image with the image's stamp: the nearest is 0.050 s before it");
}

TEST_F(CompanionPairingTest, ANewerImageReplacesOneThatWaits) {
  image(0, 0);
  image(0.033, 0.033);
  depth(0.033, 0.04);
  EXPECT_EQ(take(), (Pairs{{33, 33}}));
  EXPECT_EQ(pairing_.dropped(), 1u);
}

TEST_F(CompanionPairingTest, WithoutDepthImagesPassAfterTheTimeOut) {
  image(0, 0);
  tick(0.5);
  EXPECT_EQ(take(), Pairs());
  tick(1.1);
  EXPECT_EQ(take(), (Pairs{{0, -1}}));
  EXPECT_EQ(last_reason_, "no depth image comes");
  image(0.033, 1.2);
  EXPECT_EQ(take(), (Pairs{{33, -1}}));
  depth(0.066, 1.3);  // it comes again: images wait once more
  image(0.1, 1.31);
  EXPECT_EQ(take(), Pairs());
  depth(0.1, 1.32);
  EXPECT_EQ(take(), (Pairs{{100, 100}}));
}

TEST_F(CompanionPairingTest, AnImageWaitsNoLongerThanItMay) {
  CompanionPairing impatient(
      {0.02, 1, 0.1, "image"}, [](CameraFrame* frame) { return &frame->depth; },
      [this](CameraFrame frame) { passed_.push_back(std::move(frame)); });
  const auto at = [](double now) { return ros::WallTime(100 + now); };
  impatient.addCompanion({stamped(-0.2), nullptr}, at(0));  // it lives, and is late
  impatient.add({stamped(0), nullptr, at(0), 0}, at(0));
  impatient.tick(at(0.09));
  EXPECT_EQ(take(), Pairs());
  impatient.tick(at(0.11));
  EXPECT_EQ(take(), (Pairs{{0, -1}}));
}

TEST_F(CompanionPairingTest, AnImageOfTheSameCameraNeedsNone) {
  CompanionPairing of_lead(
      settings(), [](CameraFrame*) -> Companion* { return nullptr; },
      [this](CameraFrame frame) { passed_.push_back(std::move(frame)); });
  of_lead.add({stamped(0), nullptr, ros::WallTime(100), 0}, ros::WallTime(100));
  EXPECT_EQ(passed_.size(), 1u);
}

TEST(LeadCamera, TheFirstOneThatLivesLeads) {
  LeadCamera lead(3, 1.0);
  const auto at = [](double now) { return ros::WallTime(100 + now); };
  EXPECT_FALSE(lead.leads(1, at(0)));  // the first may still come
  EXPECT_TRUE(lead.leads(0, at(0.5)));
  EXPECT_FALSE(lead.leads(1, at(1.4)));
  EXPECT_FALSE(lead.leads(2, at(1.6)));  // the second lives
  EXPECT_TRUE(lead.leads(1, at(1.6)));   // the first is dead
  EXPECT_TRUE(lead.leads(2, at(3.0)));   // the second, too
  EXPECT_TRUE(lead.leads(0, at(3.1)));
  EXPECT_FALSE(lead.leads(2, at(3.2)));
}

TEST_F(CompanionPairingTest, AJumpOfTheClockForgetsAll) {
  depth(5, 0);
  image(5.1, 0.01);
  take();
  image(0, 0.02, 1);
  EXPECT_EQ(take(), Pairs());  // the depth of before would be newer
  depth(0, 0.03);
  EXPECT_EQ(take(), (Pairs{{0, 0}}));
}

}  // namespace
}  // namespace nerf_pose_refiner
