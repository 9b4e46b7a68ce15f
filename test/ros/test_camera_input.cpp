// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/camera_input.h"

#include <gtest/gtest.h>
#include <boost/make_shared.hpp>

#include <functional>
#include <limits>
#include <string>
#include <vector>

#include "backend/common/observed_colours.h"
#include "concurrency/error_of.h"
#include "tracking/status.h"

namespace nerf_pose_refiner {
namespace {

/// K for raw images, P for rectified ones; they differ, so that they cannot be confused.
sensor_msgs::CameraInfo someInfo() {
  sensor_msgs::CameraInfo info;
  info.width = 8;
  info.height = 6;
  info.distortion_model = "plumb_bob";
  info.D = {0, 0, 0, 0, 0};
  info.K = {10, 0, 3, 0, 11, 2, 0, 0, 1};
  info.R = {1, 0, 0, 0, 1, 0, 0, 0, 1};
  info.P = {20, 0, 4, 0, 0, 21, 5, 0, 0, 0, 1, 0};
  return info;
}

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

TrackReason reasonOf(const std::function<void()>& function) {
  try {
    function();
  } catch (const InputError& e) {
    return e.reason();
  }
  return TrackReason::kNone;
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

TrackReason reasonFor(const sensor_msgs::CameraInfo& info, bool rectified) {
  return reasonOf([&] { cameraFromMessage(info, rectified); });
}

TEST(CameraFromMessage, TakesKForRawAndPForRectifiedImages) {
  sensor_msgs::CameraInfo info = someInfo();
  info.D = {0.1, 0, 0, 0, 0};
  const CameraModel raw = cameraFromMessage(info, false);
  EXPECT_EQ(raw.camera.width, 8);
  EXPECT_EQ(raw.camera.height, 6);
  EXPECT_EQ(raw.camera.fx, 10);
  EXPECT_EQ(raw.camera.fy, 11);
  EXPECT_EQ(raw.camera.cx, 3);
  EXPECT_EQ(raw.camera.cy, 2);
  EXPECT_EQ(raw.distortion.coefficients.size(), 5u);
  const CameraModel rectified = cameraFromMessage(info, true);
  EXPECT_EQ(rectified.camera.fx, 20);
  EXPECT_EQ(rectified.camera.fy, 21);
  EXPECT_EQ(rectified.camera.cx, 4);
  EXPECT_EQ(rectified.camera.cy, 5);
  EXPECT_TRUE(rectified.distortion.isZero());
}

TEST(CameraFromMessage, HeedsBinningAndRegionOfInterest) {
  sensor_msgs::CameraInfo info = someInfo();
  info.width = 16;
  info.height = 12;
  info.binning_x = info.binning_y = 2;
  info.roi.x_offset = 2;
  info.roi.y_offset = 1;
  info.roi.width = 8;
  info.roi.height = 6;
  const Camera camera = cameraFromMessage(info, false).camera;
  EXPECT_EQ(camera.width, 4);
  EXPECT_EQ(camera.height, 3);
  EXPECT_EQ(camera.fx, 5);
  EXPECT_EQ(camera.fy, 5.5);
  EXPECT_EQ(camera.cx, 0.5);  // (3 - 2) / 2
  EXPECT_EQ(camera.cy, 0.5);  // (2 - 1) / 2
}

// Of a rectified image it is P that is cut and shrunk, by other steps along x and y.
TEST(CameraFromMessage, HeedsBinningAndRegionOfInterestOfP) {
  sensor_msgs::CameraInfo info = someInfo();
  info.width = 40;
  info.height = 30;
  info.P = {20, 0, 19, 0, 0, 21, 15, 0, 0, 0, 1, 0};
  info.binning_x = 2;
  info.binning_y = 3;
  info.roi.x_offset = 4;
  info.roi.y_offset = 6;
  info.roi.width = 24;
  info.roi.height = 18;
  const Camera camera = cameraFromMessage(info, true).camera;
  EXPECT_EQ(camera.width, 12);
  EXPECT_EQ(camera.height, 6);
  EXPECT_EQ(camera.fx, 10);
  EXPECT_EQ(camera.fy, 7);
  EXPECT_EQ(camera.cx, 7.5);  // (19 - 4) / 2
  EXPECT_EQ(camera.cy, 3);    // (15 - 6) / 3
}

// The lens bends a ray by where it points, not by which pixels are read out.
TEST(CameraFromMessage, ARegionKeepsTheDistortion) {
  sensor_msgs::CameraInfo info = someInfo();
  info.D = {0.1, -0.2, 0.001, 0.002, 0.3};
  info.roi.x_offset = 2;
  info.roi.width = 4;
  info.roi.height = 6;
  const CameraModel model = cameraFromMessage(info, false);
  EXPECT_EQ(model.camera.width, 4);
  EXPECT_EQ(model.camera.cx, 1);
  EXPECT_EQ(model.distortion.coefficients, info.D);
}

TEST(CameraFromMessage, ReadsRationalPolynomialsAndFisheyeLenses) {
  sensor_msgs::CameraInfo info = someInfo();
  info.distortion_model = "rational_polynomial";
  info.D = {0.1, 0.2, 0.001, 0.002, 0.3, 0.4, 0.5, 0.6};
  EXPECT_EQ(cameraFromMessage(info, false).distortion, Distortion{info.D});
  info.distortion_model = "equidistant";
  EXPECT_NE(reasonFor(info, false), TrackReason::kNone) << "eight";
  info.D.resize(4);
  EXPECT_EQ(cameraFromMessage(info, false).distortion.model, Distortion::Model::kFisheye);
}

TEST(CameraFromMessage, RefusesWhatItCannotUse) {
  sensor_msgs::CameraInfo info = someInfo();
  info.K[0] = 0;
  EXPECT_EQ(reasonFor(info, false), TrackReason::kUncalibrated);
  EXPECT_EQ(reasonFor(info, true), TrackReason::kNone);
  info = someInfo();
  info.P[0] = 0;
  EXPECT_EQ(reasonFor(info, true), TrackReason::kUncalibrated);
  info = someInfo();
  info.P[3] = -2.5;
  EXPECT_EQ(reasonFor(info, true), TrackReason::kBadCameraInfo) << "a right camera";
  info = someInfo();
  info.distortion_model = "thin_prism";
  EXPECT_EQ(reasonFor(info, false), TrackReason::kNone) << "without distortion any model will do";
  info.D = {0.1, 0, 0, 0};
  EXPECT_EQ(reasonFor(info, false), TrackReason::kBadCameraInfo);
  EXPECT_EQ(reasonFor(info, true), TrackReason::kNone);
  info = someInfo();
  info.width = 0;
  EXPECT_EQ(reasonFor(info, false), TrackReason::kBadCameraInfo);
}

TEST(CameraFromMessage, RefusesDistortionOfTheWrongLength) {
  for (std::size_t n = 0; n <= 20; ++n) {
    const bool known = n == 0 || n == 4 || n == 5 || n == 8;
    sensor_msgs::CameraInfo info = someInfo();
    info.D.assign(n, 0.01);
    EXPECT_EQ(reasonFor(info, false) == TrackReason::kNone, known) << n;
    EXPECT_EQ(reasonFor(info, true), TrackReason::kNone) << n << ", which P does not need";
  }
  sensor_msgs::CameraInfo info = someInfo();
  info.D[1] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_EQ(reasonFor(info, false), TrackReason::kBadCameraInfo);
}

// image_geometry rectifies such a region itself, and OpenCV throws at the length of D.
TEST(CameraFromMessage, RefusesARegionThatCannotBeRectified) {
  for (const bool rectified : {false, true}) {
    sensor_msgs::CameraInfo info = someInfo();
    info.D = {0.1, 0, 0};
    info.roi.width = 4;
    info.roi.height = 3;
    info.roi.do_rectify = true;
    EXPECT_EQ(reasonFor(info, rectified), TrackReason::kBadCameraInfo) << rectified;
  }
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

TEST(CameraToMessage, DescribesAPinholeCamera) {
  const Camera camera = cameraFromMessage(someInfo(), true).camera;
  const sensor_msgs::CameraInfo info = toMessage(camera);
  EXPECT_EQ(cameraFromMessage(info, true).camera.cy, 5);
  EXPECT_EQ(cameraFromMessage(info, false).camera.fy, 21);
  EXPECT_EQ(info.width, 8u);
  EXPECT_EQ(info.D, std::vector<double>(5, 0.0));
}

}  // namespace
}  // namespace nerf_pose_refiner
