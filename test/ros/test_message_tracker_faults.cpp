// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// What may go wrong while an object is tracked.
#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <stdexcept>
#include <string>
#include <thread>

#include "message_tracker_fixture.h"

namespace nerf_pose_refiner {
namespace {

using Status = RefinementStatus;

TEST_F(MessageTrackerTest, OutlivesABackendThatThrows) {
  useModel();
  offer();
  search_->throws = true;
  const auto result = tracker_->process(frameAt(0));
  ASSERT_TRUE(result);
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_ERROR});
  EXPECT_EQ(result->status.message, "the backend broke");
  EXPECT_EQ(result->track.observation->camera.width, 4);
  search_->throws = false;
  offer();
  EXPECT_TRUE(tracker_->process(frameAt(0.1))->pose);
}

TEST_F(MessageTrackerTest, RefusesAnInitialPoseInAnUnknownFrame) {
  useModel();
  offer("nowhere");
  const auto result = tracker_->process(frameAt(0));
  ASSERT_TRUE(result);
  EXPECT_FALSE(result->track.observation);
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_WAITING});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_PRIOR_NO_FRAME});
  EXPECT_NE(result->status.message.find("nowhere"), std::string::npos) << result->status.message;
  EXPECT_TRUE(search_->priors.empty());
}

// What is missing then is no frame of an initial pose.
TEST_F(MessageTrackerTest, SaysThatTransformsAreMissingWhileItLooksForALostObject) {
  parameters_.frames.fixed_frame = "base";
  parameters_.tracker.rules.max_failures = 0;
  restart();
  useModel();
  addTransform("base", "camera", 0, 0);
  addTransform("base", "camera", 0.1, 0);
  offer();
  EXPECT_TRUE(tracker_->process(frameAt(0))->pose);
  search_->score = 0;
  EXPECT_EQ(int{tracker_->process(frameAt(0.1))->status.state}, int{Status::STATE_LOST});
  const auto result = tracker_->process(frameAt(0.2));
  ASSERT_TRUE(result);
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_LOST});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_NO_TRANSFORM});
}

TEST_F(MessageTrackerTest, KeepsItsModelWhenAnotherCannotBeUsed) {
  useModel();
  std::future<void> done = tracker_->tracker().offerModel(fieldCalled("cursed"));
  tracker_->tracker().applyModels();
  EXPECT_THROW(done.get(), std::runtime_error);
  EXPECT_EQ(search_->object, "mug");
  offer();
  EXPECT_TRUE(tracker_->process(frameAt(0))->pose);
}

TEST_F(MessageTrackerTest, DropsTransformsWhenTimeGoesBack) {
  useModel();
  addTransform("base", "camera", 0, 1);
  EXPECT_EQ(tracker_->tracker().readClock(), 0u);
  EXPECT_TRUE(transforms_.canTransform("base", "camera", ros::Time(1000)));
  setClock(-100);
  EXPECT_EQ(tracker_->tracker().readClock(), 1u);
  EXPECT_FALSE(transforms_.canTransform("base", "camera", ros::Time(1000)));

  addTransform("base", "camera", 0, 1);
  CameraFrame frame = frameAt(0);
  frame.clock_jumps = 1;
  tracker_->process(frame);
  frame = frameAt(-10);
  frame.clock_jumps = 1;
  tracker_->process(frame);  // one wrong stamp would not matter
  EXPECT_TRUE(transforms_.canTransform("base", "camera", ros::Time(1000)));
  frame = frameAt(-9.9);
  frame.clock_jumps = 1;
  tracker_->process(frame);
  EXPECT_FALSE(transforms_.canTransform("base", "camera", ros::Time(1000)));
}

TEST_F(MessageTrackerTest, SaysWhyAnImageIsRefused) {
  CameraFrame frame = frameAt(0);
  EXPECT_FALSE(tracker_->refusal(*frame.image, *frame.info));
  sensor_msgs::CameraInfo uncalibrated = *frame.info;
  uncalibrated.K[0] = 0;
  EXPECT_TRUE(tracker_->refusal(*frame.image, uncalibrated));
  tracker_->tracker().reportChange(imageStampOf(frame.image->header));
  EXPECT_EQ(int{reports_.back().reason}, int{Status::REASON_UNCALIBRATED});
  tracker_->tracker().reportChange(imageStampOf(frame.image->header));
  EXPECT_EQ(reports_.size(), 1u) << "once";
}

TEST_F(MessageTrackerTest, RefusesCameraInfoThatOpenCvCannotRead) {
  const CameraFrame frame = frameAt(0);
  sensor_msgs::CameraInfo info = *frame.info;
  info.distortion_model = "plumb_bob";
  info.D = {0.1, 0, 0};
  info.roi.width = 2;
  info.roi.height = 1;
  info.roi.do_rectify = true;
  EXPECT_TRUE(tracker_->refusal(*frame.image, info));
  tracker_->tracker().reportChange(imageStampOf(frame.image->header));
  EXPECT_EQ(int{reports_.back().reason}, int{Status::REASON_BAD_CAMERA_INFO});
}

// What shows only when the maps are made: a lens that folds the image over itself.
TEST_F(MessageTrackerTest, OutlivesALensThatCannotBe) {
  useModel();
  offer();
  CameraFrame frame = frameAt(0);
  auto info = boost::make_shared<sensor_msgs::CameraInfo>(*frame.info);
  info->distortion_model = "plumb_bob";
  info->D = {-40, 0, 0, 0, 0};
  frame.info = info;
  const auto result = tracker_->process(frame);
  ASSERT_TRUE(result);
  EXPECT_FALSE(result->pose);
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_LOST});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_BAD_CAMERA_INFO})
      << result->status.message;
}

TEST_F(MessageTrackerTest, RefusesACovarianceThatIsTooWideToSearch) {
  useModel();
  TimedPose start;
  start.frame_id = "camera";
  start.covariance = covarianceOf(0, 500);  // the object is 0.2 m across
  tracker_->tracker().offer(start);
  const auto result = tracker_->process(frameAt(0));
  ASSERT_TRUE(result);
  EXPECT_TRUE(search_->priors.empty());
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_WAITING});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_PRIOR_BAD_COVARIANCE})
      << result->status.message;
  start.covariance = covarianceOf(500, 0.05);  // all that can be
  tracker_->tracker().offer(start);
  EXPECT_TRUE(tracker_->process(frameAt(0.1))->pose);
}

TEST_F(MessageTrackerTest, DropsAnImageFromBeforeTimeWentBack) {
  useModel();
  CameraFrame frame = frameAt(0);
  frame.clock_jumps = tracker_->tracker().readClock();
  setClock(-100);
  const std::uint32_t jumps = tracker_->tracker().readClock();
  offer();
  EXPECT_FALSE(tracker_->process(frame));
  frame = frameAt(-100);
  frame.clock_jumps = jumps;
  const auto result = tracker_->process(frame);
  ASSERT_TRUE(result) << "the initial pose is for an image of now";
  EXPECT_TRUE(result->pose);
}

// One thread reads the clock and is held up before it says what it read; meanwhile time goes on.
TEST_F(MessageTrackerTest, IsNotFooledByAThreadThatIsHeldUp) {
  std::atomic<int> reads{0};
  std::thread other;
  clock_ = [&] {
    if (++reads > 1) return ros::Time(1010);
    other = std::thread([&] { tracker_->tracker().readClock(); });
    // Long enough for the other thread to overtake, if it could.
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    return ros::Time(1000);
  };
  EXPECT_EQ(tracker_->tracker().readClock(), 0u);
  other.join();
  EXPECT_EQ(tracker_->tracker().readClock(), 0u) << "time did not go back";
}

TEST_F(MessageTrackerTest, OutlivesImagesThatChangeTheirSize) {
  useModel();
  offer();
  EXPECT_TRUE(tracker_->process(frameAt(0))->pose);
  CameraFrame frame = frameAt(0.1);
  auto image = boost::make_shared<sensor_msgs::Image>(*frame.image);
  auto info = boost::make_shared<sensor_msgs::CameraInfo>(*frame.info);
  image->width = image->step = info->width = 3;
  image->data.resize(6);
  EXPECT_TRUE(tracker_->process({image, info, frame.arrival})->pose);
  EXPECT_EQ(search_->width, 3);
}

}  // namespace
}  // namespace nerf_pose_refiner
