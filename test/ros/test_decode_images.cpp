// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <ros/ros.h>
#include <sensor_msgs/CompressedImage.h>
#include <sensor_msgs/Image.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <string>
#include <vector>

#include "graph.h"

namespace nerf_pose_refiner {
namespace {

sensor_msgs::CompressedImage compressed(const std::string& format, double stamp) {
  cv::Mat picture(6, 8, CV_8UC3, cv::Scalar(200, 100, 0));
  sensor_msgs::CompressedImage message;
  message.header.frame_id = "camera_optical";
  message.header.stamp = ros::Time(stamp);
  message.format = format;
  cv::imencode("." + format, picture, message.data);
  return message;
}

class DecodeImagesTest : public testing::Test {
 protected:
  DecodeImagesTest()
      : input_(nh_.advertise<sensor_msgs::CompressedImage>("image/compressed", 5)),
        output_(nh_, "image") {}

  void SetUp() override {
    ASSERT_TRUE(
        waitUntil([this] { return input_.getNumSubscribers() > 0 && output_.connected(); }));
  }

  ros::NodeHandle nh_;
  ros::Publisher input_;
  Listener<sensor_msgs::Image> output_;
};

TEST_F(DecodeImagesTest, GivesRawImagesWithTheSameHeader) {
  for (const char* format : {"jpg", "png"}) {
    output_.clear();
    input_.publish(compressed(format, 7));
    const auto image = output_.wait();
    ASSERT_TRUE(image) << format;
    EXPECT_EQ(image->header.frame_id, "camera_optical");
    EXPECT_EQ(image->header.stamp, ros::Time(7));
    EXPECT_EQ(image->encoding, "bgr8");
    EXPECT_EQ(image->width, 8u);
    ASSERT_EQ(image->height, 6u);
    EXPECT_NEAR(image->data[0], 200, 3);
    EXPECT_NEAR(image->data[1], 100, 3);
    EXPECT_NEAR(image->data[2], 0, 3);
  }
}

TEST_F(DecodeImagesTest, OutlivesDataThatIsNoImage) {
  sensor_msgs::CompressedImage broken = compressed("png", 1);
  broken.data.resize(20);
  input_.publish(broken);
  broken.data.clear();
  input_.publish(broken);
  // A header that asks for more than OpenCV gives: it throws.
  const std::string huge = "P6 2000000 2000000 255\n";
  broken.data.assign(huge.begin(), huge.end());
  input_.publish(broken);
  input_.publish(compressed("png", 2));
  const auto image = output_.wait();
  ASSERT_TRUE(image);
  EXPECT_EQ(image->header.stamp, ros::Time(2));
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_decode_images");
  const ros::NodeHandle keep_alive;
  ros::AsyncSpinner spinner(1);
  spinner.start();
  return RUN_ALL_TESTS();
}
