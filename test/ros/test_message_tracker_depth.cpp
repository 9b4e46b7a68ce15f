// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <boost/make_shared.hpp>

#include <cstring>
#include <string>

#include "message_tracker_fixture.h"
#include "ros/conversions/camera_input.h"

namespace nerf_pose_refiner {
namespace {

using Status = RefinementStatus;

class MessageTrackerDepthTest : public MessageTrackerTest {
 protected:
  /// A frame with depth, taken by a camera of another frame 5 ms later.
  static CameraFrame withDepth(double seconds, const std::string& frame_id = "depth_camera") {
    CameraFrame frame = frameAt(seconds);
    auto image = boost::make_shared<sensor_msgs::Image>();
    image->header.frame_id = frame_id;
    image->header.stamp = ros::Time(1000 + seconds + 0.005);
    image->width = 3;
    image->height = 2;
    image->encoding = "16UC1";
    image->step = 6;
    image->data.resize(12, 1);
    frame.depth = {
        image, boost::make_shared<sensor_msgs::CameraInfo>(toMessage(Camera{3, 2, 5, 5, 1, 0.5}))};
    return frame;
  }

  FrameResult process(const CameraFrame& frame) {
    useModel();
    offer();
    const auto result = tracker_->process(frame);
    EXPECT_TRUE(result);
    return result ? *result : FrameResult();
  }
};

TEST_F(MessageTrackerDepthTest, HandsItOnWithThePlaceOfItsCamera) {
  addTransform("camera", "depth_camera", 0, 0.05);
  addTransform("camera", "depth_camera", 1, 0.05);
  search_->depth_report.use = DepthUse::kUsed;
  search_->depth_report.agreeing = 0.75;
  search_->depth_report.bias_m = 0.002;
  const FrameResult result = process(withDepth(0));
  ASSERT_TRUE(search_->depth);
  EXPECT_NEAR(search_->depth->T_C_D.t.x(), 0.05, 1e-12);
  EXPECT_FLOAT_EQ(search_->depth->at(0, 0), 0.257f);  // bytes 1, 1
  EXPECT_EQ(int{result.status.depth}, int{Status::DEPTH_USED});
  EXPECT_FLOAT_EQ(result.status.depth_agreement, 0.75f);
  EXPECT_FLOAT_EQ(result.status.depth_bias_m, 0.002f);
  EXPECT_EQ(result.status.depth_message, "");
}

TEST_F(MessageTrackerDepthTest, ARegisteredImageNeedsNoTransform) {
  process(withDepth(0, "camera"));
  ASSERT_TRUE(search_->depth);
  EXPECT_EQ(search_->depth->T_C_D.t.norm(), 0);
}

TEST_F(MessageTrackerDepthTest, SaysWhyItIsRefused) {
  search_->depth_report.use = DepthUse::kRefused;
  search_->depth_report.message = "upside down";
  const FrameResult result = process(withDepth(0, "camera"));
  EXPECT_EQ(int{result.status.depth}, int{Status::DEPTH_REFUSED});
  EXPECT_EQ(result.status.depth_message, "upside down");
}

TEST_F(MessageTrackerDepthTest, TracksOnWithoutATransform) {
  const FrameResult result = process(withDepth(0));
  EXPECT_FALSE(search_->depth);
  EXPECT_TRUE(result.pose);
  EXPECT_EQ(int{result.status.depth}, int{Status::DEPTH_NONE});
  EXPECT_NE(result.status.depth_message.find("no transform"), std::string::npos)
      << result.status.depth_message;
}

TEST_F(MessageTrackerDepthTest, TracksOnWithDepthThatCannotBeRead) {
  CameraFrame frame = withDepth(0, "camera");
  auto image = boost::make_shared<sensor_msgs::Image>(*frame.depth.image);
  image->encoding = "rgb8";
  frame.depth.image = image;
  const FrameResult result = process(frame);
  EXPECT_FALSE(search_->depth);
  EXPECT_TRUE(result.pose);
  EXPECT_NE(result.status.depth_message.find("16UC1"), std::string::npos);
}

TEST_F(MessageTrackerDepthTest, SaysThatNoneCame) {
  CameraFrame frame = frameAt(0);
  frame.depth.why_none = "no depth image comes";
  EXPECT_EQ(process(frame).status.depth_message, "no depth image comes");
}

}  // namespace
}  // namespace nerf_pose_refiner
