// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/detection_boxes.h"

#include <gtest/gtest.h>
#include <boost/make_shared.hpp>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/calib3d.hpp>
#include <string>
#include <vector>

#include "detection_bytes.h"
#include "ros/conversions/camera_input.h"

namespace nerf_pose_refiner {
namespace {

DetectionArray read(std::vector<std::uint8_t> bytes) {
  DetectionArray array;
  ros::serialization::IStream stream(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::deserialize(stream, array);
  return array;
}

TEST(DetectionBoxes, ReadsWhatVisionMsgsWrites) {
  const DetectionArray array = read(exampleDetections());
  EXPECT_EQ(array.header.seq, 7u);
  EXPECT_EQ(array.header.frame_id, "camera_optical");
  EXPECT_EQ(array.header.stamp, ros::Time(12, 500));
  ASSERT_EQ(array.boxes.size(), 2u);
  ASSERT_EQ(array.boxes[0].classes.size(), 2u);
  EXPECT_EQ(array.boxes[0].classes[1].id, 5);
  EXPECT_EQ(array.boxes[0].classes[1].score, 0.25);
  EXPECT_EQ(array.boxes[0].centre_x, 40.5);
  EXPECT_EQ(array.boxes[0].centre_y, 30);
  EXPECT_EQ(array.boxes[0].width, 20);
  EXPECT_EQ(array.boxes[0].height, 10);
  EXPECT_EQ(array.boxes[1].classes[0].score, 0.75);
  EXPECT_EQ(array.boxes[1].centre_y, 48.25);
}

TEST(DetectionBoxes, CutAtEveryLength) {
  const std::vector<std::uint8_t> whole = exampleDetections();
  for (std::size_t length = 0; length < whole.size(); ++length) {
    EXPECT_THROW(read({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length)}),
                 ros::serialization::StreamOverrunException)
        << length;
  }
}

TEST(DetectionBoxes, AFalseNumberOfThemTakesNoMemory) {
  std::vector<std::uint8_t> bytes = exampleDetections();
  const std::size_t count_at = 4 + 8 + 4 + std::string("camera_optical").size();
  ASSERT_EQ(bytes[count_at], 2);
  std::fill_n(bytes.begin() + static_cast<std::ptrdiff_t>(count_at), 4, 0xff);
  EXPECT_THROW(read(bytes), ros::serialization::StreamOverrunException);
  bytes = exampleDetections();
  const auto pixels_at = bytes.end() - 9 - 4;  // of the last box's picture
  ASSERT_EQ(*pixels_at, 9);
  std::fill_n(pixels_at, 4, 0xff);
  EXPECT_THROW(read(bytes), ros::serialization::StreamOverrunException);
}

DetectionArray::Box boxAt(double x, double y, double width, double height) {
  DetectionArray::Box box;
  box.classes = {{1, 0.5}};
  box.centre_x = x;
  box.centre_y = y;
  box.width = width;
  box.height = height;
  return box;
}

std::vector<ImageBox> boxesOfClass(std::int64_t class_id) {
  return boxesOf(read(exampleDetections()), class_id).boxes;
}

TEST(DetectionBoxes, OfAClassTheBestFirst) {
  const std::vector<ImageBox> fifth = boxesOfClass(5);
  ASSERT_EQ(fifth.size(), 2u);
  EXPECT_EQ(fifth[0].x_min, 54);
  EXPECT_EQ(fifth[0].y_min, 40.25);
  EXPECT_EQ(fifth[0].x_max, 66);
  EXPECT_EQ(fifth[0].y_max, 56.25);
  EXPECT_EQ(fifth[1].x_min, 30.5);
  ASSERT_EQ(boxesOfClass(3).size(), 1u);
  EXPECT_EQ(boxesOfClass(3)[0].x_min, 30.5);
  EXPECT_TRUE(boxesOfClass(4).empty());
  EXPECT_EQ(boxesOfClass(-1).size(), 2u);
}

TEST(DetectionBoxes, ATurnedOneIsEnclosed) {
  DetectionArray array;
  array.boxes = {boxAt(50, 40, 20, 10)};
  array.boxes[0].angle_rad = M_PI / 6;
  const ImageBox box = boxesOf(array, -1).boxes.at(0);
  const double half_width = 10 * std::sqrt(0.75) + 2.5, half_height = 5 + 5 * std::sqrt(0.75);
  EXPECT_NEAR(box.x_min, 50 - half_width, 1e-12);
  EXPECT_NEAR(box.x_max, 50 + half_width, 1e-12);
  EXPECT_NEAR(box.y_min, 40 - half_height, 1e-12);
  EXPECT_NEAR(box.y_max, 40 + half_height, 1e-12);
}

TEST(DetectionBoxes, WithoutThoseThatMakeNoSense) {
  constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  DetectionArray array;
  array.boxes = {boxAt(kNaN, 40, 20, 10), boxAt(50, 40, 0, 10), boxAt(50, 40, 1e300, 10),
                 boxAt(50, 40, 20, -10), boxAt(50, 40, 20, 10)};
  array.boxes[4].classes[0].score = kNaN;
  EXPECT_TRUE(boxesOf(array, -1).boxes.empty());
  array.boxes[4].classes.clear();
  EXPECT_TRUE(boxesOf(array, -1).boxes.empty()) << "a detector that names no class saw nothing";
}

/// A black image of a camera with focal lengths of 500 px, and boxes in it. @param D its
/// distortion.
Observation observed(int width, int height, const std::vector<double>& D,
                     const std::vector<ImageBox>& boxes) {
  sensor_msgs::CameraInfo info;
  info.width = width;
  info.height = height;
  info.distortion_model = "plumb_bob";
  info.K = {500, 0, 0.5 * (width - 1), 0, 500, 0.5 * (height - 1), 0, 0, 1};
  info.D = D;
  auto image = boost::make_shared<sensor_msgs::Image>();
  image->header.frame_id = "camera";
  image->header.stamp = ros::Time(1);
  image->width = width;
  image->height = height;
  image->encoding = "mono8";
  image->step = width;
  image->data.resize(std::size_t{image->step} * image->height);
  ImageMasks masks;
  masks.boxes = boxes;
  return CameraInput(false).observe(image, info, masks);
}

TEST(DetectionBoxes, AreUndistortedWithTheImage) {
  const std::vector<double> barrel = {-0.3, 0.1, 0, 0, 0};
  const Observation observation =
      observed(640, 480, barrel, {{40, 60, 140, 200}, {-300, 0, -200, 100}});
  ASSERT_EQ(observation.boxes.size(), 1u) << "one lies beside the image";
  std::vector<cv::Point2d> border, moved;
  for (int i = 0; i <= 20; ++i) {
    const double x = 40 + 5 * i, y = 60 + 7 * i;
    border.insert(border.end(), {{x, 60}, {x, 200}, {40, y}, {140, y}});
  }
  const Camera& camera = observation.camera;
  const cv::Matx33d K(500, 0, 319.5, 0, 500, 239.5, 0, 0, 1);
  const cv::Matx33d P(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  cv::undistortPoints(border, moved, K, barrel, cv::noArray(), P);
  const auto by_x = [](const auto& a, const auto& b) { return a.x < b.x; };
  const auto by_y = [](const auto& a, const auto& b) { return a.y < b.y; };
  const auto [left, right] = std::minmax_element(moved.begin(), moved.end(), by_x);
  const auto [top, bottom] = std::minmax_element(moved.begin(), moved.end(), by_y);
  const ImageBox& box = observation.boxes[0];
  EXPECT_NEAR(box.x_min, left->x, 1.5);
  EXPECT_NEAR(box.y_min, top->y, 1.5);
  EXPECT_NEAR(box.x_max, right->x, 1.5);
  EXPECT_NEAR(box.y_max, bottom->y, 1.5);
  EXPECT_GT(std::abs(box.x_min - 40), 3) << "the lens distorts";
}

TEST(DetectionBoxes, AreCutToAnImageOfAnOddSize) {
  for (const double k1 : {0.0, -1e-6}) {
    const Observation observation =
        observed(641, 481, {k1, 0, 0, 0, 0}, {{1, 1, 700, 700}, {-700, -700, 2, 3}});
    ASSERT_EQ(observation.boxes.size(), 2u);
    EXPECT_NEAR(observation.boxes[0].x_min, 1, 1);
    EXPECT_NEAR(observation.boxes[0].x_max, 640.5, 0.1);
    EXPECT_NEAR(observation.boxes[0].y_max, 480.5, 0.1);
    EXPECT_NEAR(observation.boxes[1].x_min, -0.5, 0.1);
    EXPECT_NEAR(observation.boxes[1].y_max, 3, 1);
  }
}

TEST(DetectionBoxes, TheBestOfMany) {
  DetectionArray array;
  for (int i = 0; i < 100; ++i) {
    array.boxes.push_back(boxAt(i, 40, 20, 10));
    array.boxes.back().classes[0].score = i;
  }
  const std::vector<ImageBox> boxes = boxesOf(array, 1).boxes;
  ASSERT_EQ(boxes.size(), 20u);
  EXPECT_EQ(boxes[0].x_min, 89);
}

}  // namespace
}  // namespace nerf_pose_refiner
