// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/tf_bridge.h"

#include <geometry_msgs/TransformStamped.h>
#include <gtest/gtest.h>

#include <chrono>
#include <thread>

#include "ros/conversions/status.h"

namespace nerf_pose_refiner {
namespace {

const ros::Time kThen(10);
const ros::Time kNow(11);

ImageStamp cameraAt(const ros::Time& stamp) { return {"camera", toNanoseconds(stamp)}; }

class TfBridgeTest : public testing::Test {
 protected:
  /// The camera moves along x of the base: 1 m at kThen, 3 m at kNow.
  TfBridgeTest() {
    add("base", "camera", kThen, 1);
    add("base", "camera", kNow, 3);
    add("world", "base", kThen, 100);
    add("world", "base", kNow, 100);
    frames_.tf_timeout_s = 0;
  }

  void add(const std::string& parent, const std::string& child, const ros::Time& stamp, double x) {
    geometry_msgs::TransformStamped transform;
    transform.header.frame_id = parent;
    transform.header.stamp = stamp;
    transform.child_frame_id = child;
    transform.transform.translation.x = x;
    transform.transform.rotation.w = 1;
    buffer_.setTransform(transform, "test");
  }

  double startX(const std::string& frame, const ros::Time& stamp, double x) const {
    TimedPose start;
    start.frame_id = frame;
    start.stamp_ns = toNanoseconds(stamp);
    start.T_P_U.t.x() = x;
    return TfBridge(buffer_, frames_).inCamera(start, cameraAt(kNow), CancellationToken()).t.x();
  }

  FrameSettings frames_;
  mutable tf2::BufferCore buffer_;
};

TEST_F(TfBridgeTest, TakesAPoseInTheCameraAsItIs) { EXPECT_EQ(startX("camera", kThen, 0.5), 0.5); }

TEST_F(TfBridgeTest, CarriesAPoseThroughTheFixedFrame) {
  // Seen at 0.5 m from the camera at 1 m: it stands at 1.5 m, which is -1.5 m from 3 m.
  frames_.fixed_frame = "base";
  EXPECT_NEAR(startX("camera", kThen, 0.5), -1.5, 1e-12);
  EXPECT_NEAR(startX("camera", kNow, 0.5), 0.5, 1e-12);
}

TEST_F(TfBridgeTest, LetsAPoseStandStillInItsOwnFrame) {
  EXPECT_NEAR(startX("base", kThen, 4), 1, 1e-12);
  EXPECT_NEAR(startX("world", kThen, 104), 1, 1e-12);
}

TEST_F(TfBridgeTest, TakesAPoseWithoutStampForTheImagesTime) {
  frames_.fixed_frame = "world";
  EXPECT_NEAR(startX("base", ros::Time(), 4), 1, 1e-12);
}

TEST_F(TfBridgeTest, RefusesUnknownFramesAndTimes) {
  EXPECT_THROW(startX("nowhere", kThen, 0), InputError);
  frames_.fixed_frame = "base";
  EXPECT_THROW(startX("camera", ros::Time(5), 0), InputError);
  frames_.fixed_frame = "nowhere";
  EXPECT_THROW(startX("camera", kThen, 0), InputError);
}

TEST_F(TfBridgeTest, SaysWhereTheCameraWas) {
  EXPECT_EQ(TfBridge(buffer_, frames_).outputFrame("camera"), "camera");
  EXPECT_EQ(TfBridge(buffer_, frames_).cameraInOutput(cameraAt(kNow), CancellationToken()).t.x(),
            0);
  frames_.output_frame = "world";
  const TfBridge bridge(buffer_, frames_);
  EXPECT_EQ(bridge.outputFrame("camera"), "world");
  EXPECT_NEAR(bridge.cameraInOutput(cameraAt(kThen), CancellationToken()).t.x(), 101, 1e-12);
  EXPECT_NEAR(bridge.cameraInOutput(cameraAt(kNow), CancellationToken()).t.x(), 103, 1e-12);
  EXPECT_THROW(bridge.cameraInOutput(cameraAt(ros::Time(12)), CancellationToken()), InputError);
}

TEST_F(TfBridgeTest, WaitsForATransformThatIsLate) {
  frames_.tf_timeout_s = 10;
  frames_.output_frame = "base";
  const ros::Time soon(12);
  constexpr std::chrono::milliseconds kLate(100);
  const auto start = std::chrono::steady_clock::now();
  std::thread late([&] {
    std::this_thread::sleep_until(start + kLate);
    add("base", "camera", soon, 5);
  });
  double x = 0;
  EXPECT_NO_THROW(
      x = TfBridge(buffer_, frames_).cameraInOutput(cameraAt(soon), CancellationToken()).t.x());
  const auto waited = std::chrono::steady_clock::now() - start;
  late.join();
  EXPECT_NEAR(x, 5, 1e-12);
  EXPECT_GE(waited, kLate) << "it was not there before";
  EXPECT_LT(waited, std::chrono::seconds(5)) << "it does not wait on when it is there";
}

TEST_F(TfBridgeTest, WaitsNoLongerThanItMay) {
  frames_.tf_timeout_s = 0.05;
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THROW(startX("nowhere", kThen, 0), InputError);
  const std::chrono::duration<double> waited = std::chrono::steady_clock::now() - start;
  EXPECT_GE(waited.count(), 0.05);

  frames_.tf_timeout_s = 1000;
  CancellationToken cancellation;
  cancellation.requestCancel();
  frames_.output_frame = "nowhere";
  EXPECT_THROW(TfBridge(buffer_, frames_).cameraInOutput(cameraAt(kNow), cancellation), InputError);
}

}  // namespace
}  // namespace nerf_pose_refiner
