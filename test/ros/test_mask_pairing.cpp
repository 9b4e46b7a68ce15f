// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/mask_pairing.h"

#include <gtest/gtest.h>
#include <boost/make_shared.hpp>

#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace nerf_pose_refiner {
namespace {

/// An image or mask; stamps are whole seconds.
sensor_msgs::ImageConstPtr imageAt(int stamp) {
  auto image = boost::make_shared<sensor_msgs::Image>();
  image->header.stamp = ros::Time(stamp);
  return image;
}

class MaskPairingTest : public testing::Test {
 protected:
  void useMode(MaskMode mode, bool uses_boxes = false) {
    pairing_ = std::make_unique<MaskPairing>(
        mode, 1.0, [this](CameraFrame frame) { emitted_.push_back(std::move(frame)); }, uses_boxes);
  }

  void image(int stamp, double now, std::uint32_t clock_jumps = 0) {
    const ros::WallTime time(100 + now);
    pairing_->add({imageAt(stamp), nullptr, time, clock_jumps}, time);
  }
  void mask(int stamp, double now) { pairing_->addMask(imageAt(stamp), ros::WallTime(100 + now)); }
  void boxes(int stamp, double now, std::size_t count) {
    auto boxes = std::make_shared<StampedBoxes>();
    boxes->header.stamp = ros::Time(stamp);
    boxes->boxes.resize(count);
    pairing_->addBoxes(boxes, ros::WallTime(100 + now));
  }
  void ignoreMask(int stamp, double now) {
    pairing_->addIgnoreMask(imageAt(stamp), ros::WallTime(100 + now));
  }

  /// Stamps of the images that were handed on since the last call, "m" and "i" with their masks,
  /// "b" for each box.
  std::vector<std::string> takeEmitted() {
    std::vector<std::string> texts;
    for (const CameraFrame& frame : emitted_) {
      std::string text = std::to_string(frame.image->header.stamp.sec);
      if (frame.masks.object) {
        text += "m";
        EXPECT_EQ(frame.masks.object->header.stamp, frame.image->header.stamp);
      }
      if (frame.masks.ignored) text += "i";
      text += std::string(frame.masks.boxes.size(), 'b');
      texts.push_back(text);
    }
    emitted_.clear();
    return texts;
  }

  using Texts = std::vector<std::string>;
  std::unique_ptr<MaskPairing> pairing_;
  std::vector<CameraFrame> emitted_;
};

TEST_F(MaskPairingTest, WithoutMasksImagesGoOnAtOnce) {
  useMode(MaskMode::kNone);
  image(1, 0);
  EXPECT_EQ(takeEmitted(), Texts{"1"});
  image(2, 0.1);
  EXPECT_EQ(takeEmitted(), Texts{"2"});
  EXPECT_EQ(pairing_->dropped(), 0u);
}

TEST_F(MaskPairingTest, AnImageWaitsForTheMaskOfItsStamp) {
  useMode(MaskMode::kEveryFrame);
  image(1, 0);
  mask(7, 0.1);
  EXPECT_EQ(takeEmitted(), Texts{});
  mask(1, 0.2);
  EXPECT_EQ(takeEmitted(), Texts{"1m"});
  mask(2, 0.3);
  EXPECT_EQ(takeEmitted(), Texts{}) << "the mask may come first";
  image(2, 0.4);
  EXPECT_EQ(takeEmitted(), Texts{"2m"});
}

TEST_F(MaskPairingTest, AnImageWaitsForItsBoxesUntilTheObjectIsTracked) {
  useMode(MaskMode::kNone, true);
  image(1, 0);
  EXPECT_EQ(takeEmitted(), Texts{}) << "the first boxes are waited for, too";
  boxes(1, 0.2, 2);
  EXPECT_EQ(takeEmitted(), Texts{"1bb"});
  image(2, 0.3);
  EXPECT_EQ(takeEmitted(), Texts{});
  boxes(2, 0.4, 0);
  EXPECT_EQ(takeEmitted(), Texts{"2"}) << "the detector saw nothing";
  pairing_->setTracking(true);
  image(3, 0.5);
  EXPECT_EQ(takeEmitted(), Texts{"3"});
  pairing_->setTracking(false);
  image(4, 0.6);
  EXPECT_EQ(takeEmitted(), Texts{});
  pairing_->tick(ros::WallTime(101.5));
  EXPECT_EQ(takeEmitted(), Texts{"4"}) << "the detector has stopped";
}

TEST_F(MaskPairingTest, NoImageWaitsLongForBoxesOfOtherStamps) {
  useMode(MaskMode::kNone, true);
  image(1, 0);
  for (int i = 1; i <= 12; ++i) boxes(1000 + i, 0.1 * i, 1);
  EXPECT_EQ(takeEmitted(), Texts{"1"});
}

TEST_F(MaskPairingTest, ImagesOfOtherCamerasDoNotWaitForBoxes) {
  useMode(MaskMode::kNone, true);
  CameraFrame frame;
  frame.image = imageAt(1);
  frame.arrival = ros::WallTime(100);
  frame.camera = 1;
  pairing_->add(frame, frame.arrival);
  EXPECT_EQ(takeEmitted(), Texts{"1"});
}

TEST_F(MaskPairingTest, BoxesOfBeforeTheClockJumpedAreForgotten) {
  useMode(MaskMode::kNone, true);
  image(5, 0);
  boxes(7, 0.1, 1);
  image(7, 0.2, 1);
  EXPECT_EQ(takeEmitted(), Texts{});
  boxes(7, 0.3, 3);
  EXPECT_EQ(takeEmitted(), Texts{"7bbb"});
}

TEST_F(MaskPairingTest, TheNewestCompletePairWins) {
  useMode(MaskMode::kEveryFrame);
  for (int i = 1; i <= 5; ++i) image(i, 0.1 * i);
  mask(3, 0.6);
  EXPECT_EQ(takeEmitted(), Texts{"3m"});
  EXPECT_EQ(pairing_->dropped(), 2u) << "1 and 2, for 4 and 5 may still be completed";
  mask(2, 0.7);
  EXPECT_EQ(takeEmitted(), Texts{}) << "too late";
  mask(5, 0.8);
  EXPECT_EQ(takeEmitted(), Texts{"5m"});
}

TEST_F(MaskPairingTest, AfterTheTimeoutThereAreNoMasks) {
  useMode(MaskMode::kEveryFrame);
  image(1, 0);
  image(2, 0.9);
  EXPECT_EQ(takeEmitted(), Texts{});
  image(3, 1.1);
  EXPECT_EQ(takeEmitted(), Texts{"3"});
  image(4, 1.2);
  EXPECT_EQ(takeEmitted(), Texts{"4"});
  mask(4, 1.3);
  image(5, 1.4);
  EXPECT_EQ(takeEmitted(), Texts{}) << "they come again: they are waited for again";
  mask(5, 1.5);
  EXPECT_EQ(takeEmitted(), Texts{"5m"});
}

TEST_F(MaskPairingTest, ASingleImageGoesOnAfterTheTimeout) {
  useMode(MaskMode::kEveryFrame);
  image(1, 0);
  pairing_->tick(ros::WallTime(100.5));
  EXPECT_EQ(takeEmitted(), Texts{});
  pairing_->tick(ros::WallTime(101.5));
  EXPECT_EQ(takeEmitted(), Texts{"1"});
}

TEST_F(MaskPairingTest, WhileTrackingTheModeInitialWaitsForNone) {
  useMode(MaskMode::kInitial);
  image(1, 0);
  EXPECT_EQ(takeEmitted(), Texts{});
  mask(1, 0.1);
  EXPECT_EQ(takeEmitted(), Texts{"1m"});
  pairing_->setTracking(true);
  image(2, 0.2);
  EXPECT_EQ(takeEmitted(), Texts{"2"});
  pairing_->setTracking(false);
  image(3, 0.3);
  EXPECT_EQ(takeEmitted(), Texts{});
}

TEST_F(MaskPairingTest, IgnoreMasksAreWaitedForFromTheFirstOn) {
  useMode(MaskMode::kNone);
  image(1, 0);
  EXPECT_EQ(takeEmitted(), Texts{"1"});
  ignoreMask(2, 0.1);
  image(2, 0.2);
  EXPECT_EQ(takeEmitted(), Texts{"2i"});
  image(3, 0.3);
  EXPECT_EQ(takeEmitted(), Texts{});
  ignoreMask(3, 0.4);
  EXPECT_EQ(takeEmitted(), Texts{"3i"});
  image(4, 1.5);
  EXPECT_EQ(takeEmitted(), Texts{"4"}) << "none came for a second";
}

TEST_F(MaskPairingTest, BothKindsMayBeWanted) {
  useMode(MaskMode::kEveryFrame);
  ignoreMask(1, 0);
  image(1, 0.1);
  EXPECT_EQ(takeEmitted(), Texts{});
  mask(1, 0.2);
  EXPECT_EQ(takeEmitted(), Texts{"1mi"});
}

TEST_F(MaskPairingTest, AnIgnoreMaskWithoutStampHoldsForAllImages) {
  useMode(MaskMode::kNone);
  ignoreMask(0, 0);
  image(1, 0.1);
  image(2, 50);
  EXPECT_EQ(takeEmitted(), (Texts{"1i", "2i"}));
}

TEST_F(MaskPairingTest, WhatIsOfBeforeAJumpOfTimeIsForgotten) {
  useMode(MaskMode::kEveryFrame);
  image(1, 0);
  mask(5, 0.1);
  image(5, 0.2, 1);
  EXPECT_EQ(takeEmitted(), Texts{}) << "the stamp is the same, but the mask is of before";
  mask(1, 0.3);
  EXPECT_EQ(takeEmitted(), Texts{}) << "so is the image";
  mask(5, 0.4);
  EXPECT_EQ(takeEmitted(), Texts{"5m"});
}

TEST_F(MaskPairingTest, HoldsSoManyImagesAtMost) {
  useMode(MaskMode::kEveryFrame);
  const int most = static_cast<int>(MaskPairing::kMax);
  for (int i = 1; i <= most + 3; ++i) image(i, 0.001 * i);
  EXPECT_EQ(pairing_->dropped(), 3u);
  mask(3, 0.5);
  EXPECT_EQ(takeEmitted(), Texts{});
  mask(4, 0.5);
  EXPECT_EQ(takeEmitted(), Texts{"4m"});
}

}  // namespace
}  // namespace nerf_pose_refiner
