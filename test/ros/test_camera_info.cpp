// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <limits>
#include <vector>

#include "camera_messages.h"

namespace nerf_pose_refiner {
namespace {

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
