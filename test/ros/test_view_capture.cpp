// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/capture/view_capture.h"

#include <gtest/gtest.h>
#include <sensor_msgs/image_encodings.h>
#include <signal.h>
#include <sys/resource.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <memory>
#include <stdexcept>
#include <string>

#include "dataset/dataset.h"
#include "ros/conversions/pose_conversions.h"
#include "support/capture_scene.h"
#include "support/expect_error.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

class Capture : public testing::Test {
 protected:
  Capture() {
    parameters.name = "mug";
    parameters.dataset_root = folder.path();
    parameters.object_reference_frame = "board";
    parameters.has_box = true;
    parameters.box_min = {-0.1, -0.1, 0};
    parameters.box_max = {0.1, 0.1, 0.2};
    parameters.min_views = 4;
    parameters.selection.recent_images = 1;
    info = toMessage(kCaptureCamera);
    info.header.frame_id = "/camera";
  }

  /// An image with its camera_info, and the mask if there is one.
  CapturedImage image(std::uint32_t contrast = 200) {
    const auto picture = boost::make_shared<sensor_msgs::Image>(noiseImage(now, contrast));
    const auto its_info = boost::make_shared<sensor_msgs::CameraInfo>(info);
    its_info->header = picture->header;
    return {picture, its_info, mask};
  }

  void say(const Pose& T_O_C) {
    geometry_msgs::PoseStamped pose;
    pose.header.frame_id = "board";
    pose.header.stamp = now;
    pose.pose = toMessage(T_O_C);
    transforms.setTransform(toTransform(pose, "camera"), "test");
  }

  /// An image from there, a tenth of a second after the one before.
  bool look(ViewCapture* capture, const Pose& T_O_C, std::uint32_t contrast = 200) {
    now += ros::Duration(0.1);
    say(T_O_C);
    capture->add(image(contrast));
    return capture->process(now);
  }

  /// Views from all sides, and from above.
  bool lookAround(ViewCapture* capture) {
    bool complete = false;
    for (int i = 0; i < 12; ++i) {
      for (const double elevation : {0.2, 0.8}) {
        complete = look(capture, cameraOverBoard(i * M_PI / 6, elevation));
      }
    }
    return look(capture, cameraOverBoard(0, 1.5)) || complete;
  }

  TemporaryFolder folder;
  CaptureParameters parameters;
  tf2::BufferCore transforms;
  sensor_msgs::CameraInfo info;
  sensor_msgs::ImageConstPtr mask;
  ros::Time now{1000};
};

TEST_F(Capture, WritesADatasetWithPosesFromTf) {
  ViewCapture capture(parameters, transforms);
  say(cameraOverBoard(0, 0));
  capture.start(info);
  lookAround(&capture);
  EXPECT_EQ(capture.status().views, 25u);
  EXPECT_FALSE(fs::exists(folder.path() + "/mug"));
  capture.finish();
  EXPECT_FALSE(capture.capturing());
  EXPECT_EQ(capture.status().views, 25u);
  EXPECT_GT(capture.status().coverage, 0.6);

  const Dataset dataset = loadDataset(folder.path() + "/mug");
  ASSERT_EQ(dataset.views.size(), 25u);
  EXPECT_EQ(dataset.metres_per_unit, 1);
  EXPECT_TRUE(dataset.has_box);
  const Pose expected = cameraOverBoard(M_PI / 6, 0.2);
  EXPECT_TRUE(dataset.views[2].T_O_C.R.isApprox(expected.R, 1e-9));
  EXPECT_TRUE(dataset.views[2].T_O_C.t.isApprox(expected.t, 1e-9));
  EXPECT_NEAR(dataset.views[2].camera.cx, kCaptureCamera.cx, 1e-12);
  EXPECT_EQ(dataset.views[2].rgba->values[0], image().image->data[0]);
}

TEST_F(Capture, RefusesWhatIsSeenFromOneSide) {
  ViewCapture capture(parameters, transforms);
  say(cameraOverBoard(0, 0));
  capture.start(info);
  for (int i = 0; i < 6; ++i) look(&capture, cameraOverBoard(0.3 * i, 0.5));
  expectError<std::runtime_error>([&] { capture.finish(); }, "one-sided", " -x ", " -y ", "board");
  EXPECT_TRUE(capture.capturing());  // what is missing may still come
  lookAround(&capture);
  capture.finish();
  EXPECT_TRUE(fs::exists(folder.path() + "/mug/transforms.json"));
}

TEST_F(Capture, WantsEnoughViews) {
  parameters.min_coverage = 0;
  ViewCapture capture(parameters, transforms);
  say(cameraOverBoard(0, 0));
  capture.start(info);
  look(&capture, cameraOverBoard(0, 0));
  expectError<std::runtime_error>([&] { capture.finish(); }, "1 views", "min_views");
}

TEST_F(Capture, StandingStillAndBlurGiveNoViews) {
  parameters.selection.recent_images = 3;
  ViewCapture capture(parameters, transforms);
  say(cameraOverBoard(0, 0));
  capture.start(info);
  for (int i = 0; i < 5; ++i) look(&capture, cameraOverBoard(0, 0));
  look(&capture, cameraOverBoard(1, 0), 100);  // half the contrast, a quarter of the variance
  const CaptureStatus status = capture.status();
  EXPECT_EQ(status.views, 1u);
  EXPECT_EQ(status.images, 6u);
  EXPECT_EQ(status.too_near, 2u);
  EXPECT_EQ(status.blurred, 3u);  // two before there was something to compare with
}

TEST_F(Capture, EndsByItselfOnceAllIsCovered) {
  parameters.max_views = 4;
  ViewCapture capture(parameters, transforms);
  say(cameraOverBoard(0, 0));
  capture.start(info);
  for (int i = 0; i < 8; ++i) EXPECT_FALSE(look(&capture, cameraOverBoard(0.2 * i, 0.5)));
  EXPECT_TRUE(lookAround(&capture));
  EXPECT_LT(capture.status().views, 25u);  // only what was missing was kept
}

TEST_F(Capture, WaitsForTfAndThenGoesOn) {
  ViewCapture capture(parameters, transforms);
  say(cameraOverBoard(0, 0));
  capture.start(info);
  now += ros::Duration(1);
  capture.add(image());
  capture.process(now + ros::Duration(0.4));
  EXPECT_EQ(capture.status().no_transform, 0u);
  say(cameraOverBoard(0.1, 0));  // late, but in time
  capture.process(now + ros::Duration(0.4));
  EXPECT_EQ(capture.status().views, 1u);
  now += ros::Duration(1);
  capture.add(image());
  capture.process(now + ros::Duration(0.6));
  EXPECT_EQ(capture.status().no_transform, 1u);
  EXPECT_NE(capture.status().message, "");
}

TEST_F(Capture, RefusesToStartWithoutTf) {
  ViewCapture capture(parameters, transforms);
  expectError<std::runtime_error>([&] { capture.start(info); }, "TF", "board");
  EXPECT_FALSE(capture.capturing());
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST_F(Capture, AbortLeavesNothing) {
  {
    ViewCapture capture(parameters, transforms);
    say(cameraOverBoard(0, 0));
    capture.start(info);
    look(&capture, cameraOverBoard(0, 0));
    capture.abort();
    EXPECT_TRUE(fs::is_empty(folder.path()));
    capture.start(info);  // and it can start again
    look(&capture, cameraOverBoard(0, 0));
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST_F(Capture, MasksBecomeAlpha) {
  parameters.use_masks = true;
  parameters.has_box = false;
  auto half = boost::make_shared<sensor_msgs::Image>();
  half->encoding = sensor_msgs::image_encodings::MONO8;
  half->width = half->step = kCaptureCamera.width;
  half->height = kCaptureCamera.height;
  half->data.assign(std::size_t{half->step} * half->height, 0);
  mask = half;
  ViewCapture capture(parameters, transforms);
  say(cameraOverBoard(0, 0));
  capture.start(info);
  look(&capture, cameraOverBoard(0, 0));
  EXPECT_EQ(capture.status().refused, 1u);
  EXPECT_NE(capture.status().message.find("empty"), std::string::npos);
  std::fill(half->data.begin(), half->data.begin() + 100, 1);
  lookAround(&capture);
  capture.finish();
  const Dataset dataset = loadDataset(folder.path() + "/mug");
  EXPECT_TRUE(dataset.has_alpha);
  EXPECT_FALSE(dataset.has_box);
  EXPECT_EQ(dataset.views[0].rgba->values[3], 255);
  EXPECT_EQ(dataset.views[0].rgba->values[4 * 100 + 3], 0);
}

TEST_F(Capture, ACameraThatChangesIsRefused) {
  ViewCapture capture(parameters, transforms);
  say(cameraOverBoard(0, 0));
  capture.start(info);
  info = toMessage(kCaptureCamera.scaled(0.5));
  look(&capture, cameraOverBoard(0, 0));
  EXPECT_EQ(capture.status().refused, 1u);
  EXPECT_NE(capture.status().message.find("camera_info"), std::string::npos);
}

// The difference of such times is out of the range of ros::Duration.
TEST_F(Capture, OneBadStampCostsOneImage) {
  ViewCapture capture(parameters, transforms);
  say(cameraOverBoard(0, 0));
  capture.start(info);
  look(&capture, cameraOverBoard(0, 0));
  const ros::Time good = now;
  now = ros::Time(4294967295u, 0);
  capture.add(image());
  now = good;
  EXPECT_NO_THROW(capture.process(now));
  EXPECT_EQ(capture.status().no_transform, 1u);
  lookAround(&capture);
  EXPECT_EQ(capture.status().views, 26u);  // with that before
  EXPECT_NO_THROW(capture.finish());
}

TEST_F(Capture, AFullDiskCostsNoViewThatIsWritten) {
  ViewCapture capture(parameters, transforms);
  say(cameraOverBoard(0, 0));
  capture.start(info);
  lookAround(&capture);
  rlimit before;
  getrlimit(RLIMIT_FSIZE, &before);
  const auto ignored = signal(SIGXFSZ, SIG_IGN);
  const rlimit little = {10, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &little);
  EXPECT_NO_THROW(look(&capture, cameraOverBoard(0.3, 0.5)));
  EXPECT_NE(capture.status().message.find("File too large"), std::string::npos);
  expectError<std::runtime_error>([&] { capture.finish(); }, "File too large");
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, ignored);
  EXPECT_TRUE(capture.capturing());
  EXPECT_EQ(capture.status().refused, 1u);
  EXPECT_EQ(capture.status().views, 25u);
  capture.finish();
  EXPECT_EQ(loadDataset(folder.path() + "/mug").views.size(), 25u);
}

TEST_F(Capture, ATargetThatAppearsMeanwhileCostsNoView) {
  ViewCapture capture(parameters, transforms);
  say(cameraOverBoard(0, 0));
  capture.start(info);
  lookAround(&capture);
  folder.write("mug/transforms.json", "another's");
  capture.finish();
  EXPECT_EQ(capture.status().dataset, "mug_2");
  EXPECT_NE(capture.status().message.find("'mug_2'"), std::string::npos);
  EXPECT_EQ(loadDataset(folder.path() + "/mug_2").views.size(), 25u);
}

TEST_F(Capture, TwoOfOneNameDoNotDisturbEachOther) {
  ViewCapture first(parameters, transforms), second(parameters, transforms);
  say(cameraOverBoard(0, 0));
  first.start(info);
  expectError<std::runtime_error>([&] { second.start(info); }, "mug", "being written");
  lookAround(&first);
  first.finish();
  EXPECT_EQ(loadDataset(folder.path() + "/mug").views.size(), 25u);
}

TEST_F(Capture, NamesParametersThatMakeNoSense) {
  const auto refused = [this](const std::string& part) {
    expectError<std::invalid_argument>([&] { ViewCapture(parameters, transforms); }, part);
  };
  const CaptureParameters good = parameters;
  parameters.has_box = false;
  refused("use_masks");
  parameters = good;
  parameters.object_reference_frame.clear();
  refused("object_reference_frame");
  parameters = good;
  parameters.name = "../mug";
  refused("name");
  parameters = good;
  parameters.max_views = 2;
  refused("max_views");
}

}  // namespace
}  // namespace nerf_pose_refiner
