// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/depth_input.h"

#include <gtest/gtest.h>
#include <boost/make_shared.hpp>

#include <cstring>
#include <functional>
#include <string>
#include <vector>

#include "backend/common/observed_colours.h"
#include "ros/conversions/camera_input.h"
#include "tracking/status.h"

namespace nerf_pose_refiner {
namespace {

const Camera kSmall = {3, 2, 5, 5, 1, 0.5};

template <typename T>
Companion messagesOf(const std::string& encoding, const std::vector<T>& values) {
  auto image = boost::make_shared<sensor_msgs::Image>();
  image->width = 3;
  image->height = 2;
  image->encoding = encoding;
  image->step = 3 * sizeof(T);
  image->data.resize(sizeof(T) * values.size());
  std::memcpy(image->data.data(), values.data(), image->data.size());
  return {image, boost::make_shared<sensor_msgs::CameraInfo>(toMessage(kSmall))};
}

Companion millimetres() { return messagesOf<std::uint16_t>("16UC1", {500, 600, 0, 700, 65535, 1}); }

std::shared_ptr<const DepthImage> read(const Companion& messages, const Pose& T_C_D = {},
                                       const DepthSettings& settings = {}) {
  return depthFromMessage(messages.image, *messages.info, T_C_D, settings);
}

std::string refusalOf(
    const std::function<void(sensor_msgs::Image*, sensor_msgs::CameraInfo*)>& change) {
  auto image = boost::make_shared<sensor_msgs::Image>(*millimetres().image);
  auto info = boost::make_shared<sensor_msgs::CameraInfo>(*millimetres().info);
  change(image.get(), info.get());
  try {
    depthFromMessage(image, *info, {}, {});
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

TEST(DepthInput, ReadsMillimetres) {
  const auto depth = read(millimetres());
  EXPECT_FLOAT_EQ(depth->at(0, 0), 0.5f);
  EXPECT_EQ(depth->at(2, 0), 0);
  EXPECT_FLOAT_EQ(depth->at(1, 1), 65.535f);
}

TEST(DepthInput, ReadsMetresAndAnyUnit) {
  const auto metres = messagesOf<float>("32FC1", {0.5f, 1.5f, 0, 1, 1, 1});
  EXPECT_FLOAT_EQ(read(metres)->at(1, 0), 1.5f);
  DepthSettings settings;
  settings.unit_m = 0.0001;
  settings.noise.constant_m = 0.007;
  const Pose T_C_D(Eigen::Matrix3d::Identity(), {0.1, 0, 0});
  const auto depth = read(millimetres(), T_C_D, settings);
  EXPECT_FLOAT_EQ(depth->at(0, 0), 0.05f);
  EXPECT_EQ(depth->noise.constant_m, 0.007);
  EXPECT_EQ(depth->T_C_D.t.x(), 0.1);
  EXPECT_TRUE(depth->camera == kSmall);
}

TEST(DepthInput, KeepsTheMessage) {
  std::shared_ptr<const DepthImage> depth;
  {
    const Companion messages = millimetres();
    depth = read(messages);
    EXPECT_EQ(depth->data, messages.image->data.data()) << "without a copy";
  }
  EXPECT_FLOAT_EQ(depth->at(1, 0), 0.6f);
}

TEST(DepthInput, IsAnImageInPlaceOfColours) {
  Companion messages = millimetres();
  auto image = boost::make_shared<sensor_msgs::Image>(*messages.image);
  EXPECT_TRUE(isDepthImage(*image));
  CameraInput colours(false);
  EXPECT_THROW(colours.observe(image, *messages.info), InputError);
  DepthSettings settings;
  settings.noise.constant_m = 0.007;
  CameraInput any(false, settings);
  EXPECT_THROW(any.observe(image, *messages.info), InputError) << "no stamp";
  image->header.stamp = ros::Time(1);
  image->header.frame_id = "depth_optical";
  const Observation observation = any.observe(image, *messages.info);
  EXPECT_TRUE(observation.isDepthAlone());
  EXPECT_TRUE(observation.camera == kSmall);
  EXPECT_EQ(observation.depth->noise.constant_m, 0.007);
  checkDepthImage(*image, *messages.info, settings);
  image->data.pop_back();
  EXPECT_THROW(checkDepthImage(*image, *messages.info, settings), InputError);
  image->encoding = "mono16";
  EXPECT_FALSE(isDepthImage(*image)) << "a grey image of 16 bits";
}

TEST(DepthInput, ItsPictureShowsNearThingsBright) {
  Companion messages = messagesOf<float>("32FC1", {0.5f, 1.5f, 0, 1, 1, 1});
  const Image picture = overlayGround(observe(read(messages)));
  EXPECT_GT(picture.at(0, 0, 0), picture.at(0, 1, 0));
  EXPECT_GE(picture.at(0, 1, 1), picture.at(1, 0, 1));
  EXPECT_EQ(picture.at(2, 0, 2), 0) << "not measured";
}

TEST(DepthInput, RefusesWhatItCannotRead) {
  using Image = sensor_msgs::Image;
  using Info = sensor_msgs::CameraInfo;
  EXPECT_EQ(refusalOf([](Image*, Info*) {}), "");
  EXPECT_NE(refusalOf([](Image* image, Info*) { image->encoding = "rgb8"; }).find("16UC1"),
            std::string::npos);
  EXPECT_NE(refusalOf([](Image* image, Info*) { image->is_bigendian = 1; }).find("byte order"),
            std::string::npos);
  EXPECT_NE(refusalOf([](Image* image, Info*) { image->data.pop_back(); }).find("bytes"),
            std::string::npos);
  EXPECT_NE(refusalOf([](Image*, Info* info) { info->width = 4; }).find("3 x 2"),
            std::string::npos);
  EXPECT_NE(refusalOf([](Image*, Info* info) { info->K[0] = 0; }).find("not calibrated"),
            std::string::npos);
  EXPECT_NE(refusalOf([](Image*, Info* info) { info->D[0] = 0.1; }).find("distorts"),
            std::string::npos);
}

}  // namespace
}  // namespace nerf_pose_refiner
