// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <boost/make_shared.hpp>

#include <functional>
#include <string>

#include "backend/common/observed_colours.h"
#include "camera_messages.h"
#include "concurrency/error_of.h"

namespace nerf_pose_refiner {
namespace {

/// Red in the left half, blue in the right one; mono8: white and black.
sensor_msgs::Image someImage(const std::string& encoding) {
  sensor_msgs::Image image;
  image.header.frame_id = "camera_optical";
  image.header.stamp = ros::Time(1);
  image.width = 8;
  image.height = 6;
  image.encoding = encoding;
  const bool bgr = encoding[0] == 'b';
  const std::size_t channels = encoding == "mono8" ? 1 : encoding.size() - 1;
  image.step = static_cast<std::uint32_t>(8 * channels + 5);  // rows are padded
  image.data.assign(image.step * image.height, 77);
  for (std::size_t y = 0; y < 6; ++y) {
    for (std::size_t x = 0; x < 8; ++x) {
      std::uint8_t* pixel = &image.data[y * image.step + x * channels];
      pixel[0] = x < 4 ? 255 : 0;
      if (channels == 1) continue;
      pixel[bgr ? 2 : 0] = x < 4 ? 255 : 0;
      pixel[1] = 0;
      pixel[bgr ? 0 : 2] = x < 4 ? 0 : 255;
      if (channels == 4) pixel[3] = 9;  // whatever it means, it is not opacity
    }
  }
  return image;
}

std::string textOf(const std::function<void()>& function) { return errorOf(function).value_or(""); }

/// 8 x 6, zero but for the given columns.
sensor_msgs::ImagePtr someMask(int first_column, int last_column) {
  auto mask = boost::make_shared<sensor_msgs::Image>();
  mask->width = 8;
  mask->height = 6;
  mask->encoding = "mono8";
  mask->step = 11;  // rows are padded
  mask->data.assign(11 * 6, 0);
  for (int y = 0; y < 6; ++y) {
    for (int x = first_column; x <= last_column; ++x) {
      mask->data[static_cast<std::size_t>(11 * y + x)] = static_cast<std::uint8_t>(1 + x);
    }
  }
  return mask;
}

TrackReason reasonFor(const sensor_msgs::Image& image) {
  return reasonOf([&] { checkImage(image, cameraFromMessage(someInfo(), false).camera); });
}

TEST(CheckImage, RefusesWhatItCannotUse) {
  EXPECT_EQ(reasonFor(someImage("rgb8")), TrackReason::kNone);
  sensor_msgs::Image image = someImage("rgb8");
  image.encoding = "bayer_rggb8";
  EXPECT_EQ(reasonFor(image), TrackReason::kBadImage);
  image.encoding = "nonsense";
  EXPECT_EQ(reasonFor(image), TrackReason::kBadImage);
  image = someImage("rgb8");
  image.data.pop_back();
  EXPECT_EQ(reasonFor(image), TrackReason::kBadImage);
  image = someImage("rgb8");
  image.data.push_back(0);
  EXPECT_EQ(reasonFor(image), TrackReason::kBadImage);
  image = someImage("rgb8");
  image.step = 23;
  image.data.resize(23 * 6);
  EXPECT_EQ(reasonFor(image), TrackReason::kBadImage);
  image = someImage("rgb8");
  image.header.stamp = ros::Time();
  EXPECT_EQ(reasonFor(image), TrackReason::kBadImage);
  image = someImage("rgb8");
  image.header.frame_id.clear();
  EXPECT_EQ(reasonFor(image), TrackReason::kBadImage);
  image.header.frame_id = "/";
  EXPECT_EQ(reasonFor(image), TrackReason::kBadImage);
  image = someImage("rgb8");
  image.width = 7;
  EXPECT_EQ(reasonFor(image), TrackReason::kBadCameraInfo);
}

// Whoever is refused is told what to do.
TEST(CheckImage, NamesWhatConverts) {
  const auto text_for = [](const std::string& encoding) {
    sensor_msgs::Image image = someImage("rgb8");
    image.encoding = encoding;
    return textOf([&] { checkImage(image, cameraFromMessage(someInfo(), false).camera); });
  };
  for (const std::string encoding :
       {"bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8", "bayer_rggb16", "yuv422"}) {
    EXPECT_NE(text_for(encoding).find("'" + encoding + "'"), std::string::npos) << encoding;
    EXPECT_NE(text_for(encoding).find("image_proc/debayer"), std::string::npos) << encoding;
  }
  for (const std::string encoding : {"mono16", "rgb16", "bgr16", "rgba16", "bgra16"}) {
    EXPECT_NE(text_for(encoding).find("16 bits"), std::string::npos) << encoding;
  }
  for (const std::string encoding : {"16UC1", "32FC1"}) {
    EXPECT_NE(text_for(encoding).find("depth"), std::string::npos) << encoding;
  }
  EXPECT_NE(text_for("nonsense").find("rgb8, bgr8, rgba8, bgra8 and mono8"), std::string::npos);
  for (const std::string model : {"fisheye", "thin_prism"}) {
    sensor_msgs::CameraInfo info = someInfo();
    info.distortion_model = model;
    info.D = {0.1, 0, 0, 0};
    const std::string text = textOf([&] { cameraFromMessage(info, false); });
    EXPECT_NE(text.find("'" + model + "'"), std::string::npos) << text;
    EXPECT_NE(text.find("image_proc/rectify"), std::string::npos) << text;
  }
}

sensor_msgs::ImageConstPtr sharedImage(const char* encoding) {
  return boost::make_shared<const sensor_msgs::Image>(someImage(encoding));
}

class EncodingTest : public testing::TestWithParam<const char*> {};

TEST_P(EncodingTest, BecomesRgb) {
  CameraInput input(false);
  const Observation observation = input.observe(sharedImage(GetParam()), someInfo());
  observation.validate();
  EXPECT_EQ(observation.background, Background::kUnknown);
  EXPECT_EQ(observation.camera.fx, 10);
  const Image colours = observedColours(observation);
  const bool grey = std::string(GetParam()) == "mono8";
  for (int c = 0; c < 3; ++c) {
    EXPECT_EQ(colours.at(1, 5, c), grey || c == 0 ? 1.0f : 0.0f) << c;
    EXPECT_EQ(colours.at(7, 0, c), !grey && c == 2 ? 1.0f : 0.0f) << c;
  }
}

INSTANTIATE_TEST_SUITE_P(CameraInput, EncodingTest,
                         testing::Values("rgb8", "bgr8", "rgba8", "bgra8", "mono8"));

TEST(CameraInput, TakesTheDistortionOutOfRawImagesOnly) {
  sensor_msgs::CameraInfo info = someInfo();
  info.D = {-0.2, 0, 0, 0, 0};
  const Observation raw = CameraInput(false).observe(sharedImage("rgb8"), info);
  EXPECT_NE(raw.camera.fx, 10) << "the undistorted image is a part of the distorted one";
  const Observation rectified = CameraInput(true).observe(sharedImage("rgb8"), info);
  EXPECT_EQ(rectified.camera.fx, 20);
}

TEST(CameraInput, AMaskSaysWhereTheObjectIs) {
  const Observation observation =
      CameraInput(false).observe(sharedImage("rgb8"), someInfo(), {someMask(2, 4), nullptr});
  observation.validate();
  EXPECT_EQ(observation.background, Background::kMask);
  EXPECT_TRUE(observation.weight.empty());
  EXPECT_EQ(observedColours(observation).at(1, 5, 0), 1.0f) << "colours are as the camera saw them";
  for (int x = 0; x < 8; ++x) {
    EXPECT_EQ(observation.alpha.at(x, 3, 0), x >= 2 && x <= 4 ? 1.0f : 0.0f) << x;
  }
}

TEST(CameraInput, IgnoredPixelsHaveNoWeight) {
  const Observation observation =
      CameraInput(false).observe(sharedImage("rgb8"), someInfo(), {nullptr, someMask(5, 7)});
  observation.validate();
  EXPECT_EQ(observation.background, Background::kUnknown);
  EXPECT_TRUE(observation.alpha.empty());
  for (int x = 0; x < 8; ++x) {
    EXPECT_EQ(observation.weight.at(x, 3, 0), x >= 5 ? 0.0f : 1.0f) << x;
  }
}

// The left half is red, and so says the mask: that must be so after the undistortion, too.
TEST(CameraInput, MasksAreUndistortedWithTheirImage) {
  sensor_msgs::CameraInfo info = someInfo();
  info.D = {-0.4, 0, 0, 0, 0};
  info.K = {4, 0, 2, 0, 4, 2, 0, 0, 1};
  const Observation observation =
      CameraInput(false).observe(sharedImage("rgb8"), info, {someMask(0, 3), someMask(4, 7)});
  observation.validate();
  const Image colours = observedColours(observation);
  bool fraction = false;
  for (int y = 0; y < 6; ++y) {
    for (int x = 0; x < 8; ++x) {
      const float red = colours.at(x, y, 0), alpha = observation.alpha.at(x, y, 0);
      fraction = fraction || (alpha > 0 && alpha < 1);
      EXPECT_NEAR(alpha, red, 0.005) << x << ", " << y;
      EXPECT_EQ(observation.weight.at(x, y, 0), alpha == 1 ? 1.0f : 0.0f) << x << ", " << y;
    }
  }
  EXPECT_TRUE(fraction) << "nothing was undistorted";
}

TEST(CameraInput, RefusesMasksOfAnotherKindOrSize) {
  const auto reason_for = [](const std::function<void(sensor_msgs::Image*)>& change) {
    const sensor_msgs::ImagePtr mask = someMask(0, 7);
    change(mask.get());
    CameraInput input(false);
    const auto with = [&](const ImageMasks& masks) {
      return reasonOf([&] { input.observe(sharedImage("rgb8"), someInfo(), masks); });
    };
    EXPECT_EQ(with({mask, nullptr}), with({nullptr, mask}));
    return with({mask, nullptr});
  };
  EXPECT_EQ(reason_for([](auto*) {}), TrackReason::kNone);
  EXPECT_EQ(reason_for([](auto* m) { m->encoding = "8UC1"; }), TrackReason::kNone);
  EXPECT_EQ(reason_for([](auto* m) { m->encoding = "rgb8"; }), TrackReason::kBadMask);
  EXPECT_EQ(reason_for([](auto* m) { m->encoding = "mono16"; }), TrackReason::kBadMask);
  EXPECT_EQ(reason_for([](auto* m) { m->data.pop_back(); }), TrackReason::kBadMask);
  EXPECT_EQ(reason_for([](auto* m) { m->step = 7; }), TrackReason::kBadMask);
  EXPECT_EQ(reason_for([](auto* m) { m->width = 7; }), TrackReason::kBadMask);
  EXPECT_EQ(reason_for([](auto* m) { m->height = 3, m->step = 22; }), TrackReason::kBadMask);
}

TEST(CameraInput, FollowsACameraThatChanges) {
  CameraInput input(false);
  sensor_msgs::CameraInfo info = someInfo();
  EXPECT_EQ(input.observe(sharedImage("rgb8"), info).camera.fx, 10);
  info.K[0] = 15;
  EXPECT_EQ(input.observe(sharedImage("rgb8"), info).camera.fx, 15);
  const auto small = boost::make_shared<sensor_msgs::Image>(someImage("rgb8"));
  small->height = info.height = 3;
  small->data.resize(small->data.size() / 2);
  EXPECT_EQ(input.observe(small, info).pixels->height(), 3);
}

TEST(CameraInput, InputsOfOneMessageShareItsPixels) {
  CameraInput first(false), second(false), rectified(true);
  sensor_msgs::CameraInfo info = someInfo();
  info.D = {-0.2, 0, 0, 0, 0};
  const sensor_msgs::ImageConstPtr message = sharedImage("rgb8");
  // The first one's observation is gone when the second one comes.
  const std::weak_ptr<const CameraPixels> weak = first.observe(message, info).pixels;
  const auto pixels = second.observe(message, info).pixels;
  EXPECT_EQ(weak.lock(), pixels);
  EXPECT_NE(rectified.observe(message, info).pixels, pixels);
  EXPECT_NE(second.observe(sharedImage("rgb8"), info).pixels, pixels);
  info.D[0] = -0.1;
  EXPECT_NE(second.observe(message, info).pixels, pixels);
}

}  // namespace
}  // namespace nerf_pose_refiner
