// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Several cameras, and one that moves as several.
#include <gtest/gtest.h>

#include <chrono>
#include <optional>
#include <string>
#include <thread>

#include "message_tracker_fixture.h"

namespace nerf_pose_refiner {
namespace {

class MessageTrackerCamerasTest : public MessageTrackerTest {
 protected:
  MessageTrackerCamerasTest() {
    parameters_.cameras.topics = "left/image_raw  right/image_raw";
    parameters_.cameras.position_dev_m = 0.003;
    parameters_.tracker.rules.cameras_change = true;
    restart();
  }

  /// A frame with an image of the left camera, 5 ms later; the right one is dead.
  static CameraFrame withLeft(double seconds = 0) {
    CameraFrame frame = frameAt(seconds);
    const CameraFrame left = frameAt(seconds + 0.005, "left_camera");
    frame.side_views = {{left.image, left.info}, {nullptr, nullptr, "no image comes"}};
    return frame;
  }

  void begin() {
    useModel();
    offer();
  }

  FrameResult process(const CameraFrame& frame) {
    const auto result = tracker_->process(frame);
    EXPECT_TRUE(result);
    return result ? *result : FrameResult();
  }

  FrameResult processFirst(const CameraFrame& frame) {
    begin();
    return process(frame);
  }

  void placeLeft() {
    addTransform("camera", "left_camera", -1, -0.4);
    addTransform("camera", "left_camera", 9, -0.4);
  }
};

TEST_F(MessageTrackerCamerasTest, HandsOnTheirImagesAndPlaces) {
  placeLeft();
  search_->side_view_reports.resize(1);
  search_->side_view_reports[0].used = true;
  const FrameResult result = processFirst(withLeft());
  ASSERT_EQ(search_->side_views.size(), 1u);
  EXPECT_NEAR(search_->side_views[0].T_C_V.t.x(), -0.4, 1e-12);
  EXPECT_EQ(search_->side_views[0].position_dev_m, 0.003);
  EXPECT_EQ(search_->side_views[0].observation->camera.width, 4);
  EXPECT_NEAR(search_->side_views[0].after_s, 0.005, 1e-9);
  EXPECT_EQ(search_->side_views[0].camera, 1);
  EXPECT_EQ(int{result.status.cameras}, 2);
  EXPECT_EQ(result.status.cameras_used, "image left/image_raw");
  EXPECT_EQ(result.status.cameras_message, "right/image_raw: no image comes");
}

TEST_F(MessageTrackerCamerasTest, SaysWhereEachImageShowsTheObject) {
  placeLeft();
  search_->side_view_reports.resize(1);
  setClock(0);
  FrameResult result = processFirst(withLeft());
  ASSERT_EQ(result.views.size(), 2u);
  EXPECT_EQ(result.views[0].camera, 0u);
  EXPECT_EQ(result.views[0].header.frame_id, "camera");
  EXPECT_EQ(result.views[0].observation, result.track.observation);
  EXPECT_EQ(result.views[0].T_O_V.t, search_->T_O_C.t);
  const PlacedView& left = result.views[1];
  EXPECT_EQ(left.camera, 1u);
  EXPECT_EQ(left.header.frame_id, "left_camera");
  EXPECT_NEAR(left.header.stamp.toSec(), 1000.005, 1e-6);
  EXPECT_EQ(left.observation, search_->side_views[0].observation);
  EXPECT_NEAR(left.T_O_V.t.x(), -4, 1e-9);  // 0.4 m beside, in units of 0.1 m
  EXPECT_NEAR(left.T_O_V.t.z(), -1, 1e-9);
  // The object moves, and is found elsewhere by the time of the left camera's image.
  search_->side_view_reports[0].T_C_V = Pose(Eigen::Matrix3d::Identity(), {-0.5, 0, 0});
  setClock(0.1);
  result = process(withLeft(0.1));
  ASSERT_EQ(result.views.size(), 2u);
  EXPECT_NEAR(result.views[1].T_O_V.t.x(), -5, 1e-9);
}

TEST_F(MessageTrackerCamerasTest, SaysWhyOneHadNoPart) {
  placeLeft();
  search_->side_view_reports.resize(1);
  search_->side_view_reports[0].message = "covered";
  const FrameResult result = processFirst(withLeft());
  EXPECT_EQ(int{result.status.cameras}, 1);
  EXPECT_EQ(result.status.cameras_message,
            "right/image_raw: no image comes; left/image_raw: covered");
}

TEST_F(MessageTrackerCamerasTest, TracksOnWhereOneHasNoTransform) {
  const FrameResult result = processFirst(withLeft());
  EXPECT_TRUE(search_->side_views.empty());
  EXPECT_TRUE(result.pose);
  EXPECT_EQ(int{result.status.cameras}, 1);
  EXPECT_NE(result.status.cameras_message.find("left/image_raw: no transform"), std::string::npos)
      << result.status.cameras_message;
}

TEST_F(MessageTrackerCamerasTest, AStopEndsTheWaitForATransform) {
  parameters_.frames.tf_timeout_s = 60;
  restart();
  begin();
  std::thread stopping([this] {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    tracker_->tracker().stop();
  });
  const auto start = std::chrono::steady_clock::now();
  process(withLeft());
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
  stopping.join();
}

/// Somebody else says where a camera stands at each moment.
TEST_F(MessageTrackerCamerasTest, ACameraThatMovesIsWhereItWasWhenItTookItsImage) {
  addTransform("camera", "left_camera", 0, -0.4);
  addTransform("camera", "left_camera", 1, 0.6);  // 1 m/s
  processFirst(withLeft());
  ASSERT_EQ(search_->side_views.size(), 1u);
  EXPECT_NEAR(search_->side_views[0].T_C_V.t.x(), -0.4 + 0.005, 1e-9);
}

TEST_F(MessageTrackerCamerasTest, ThePoseIsAtTheStampOfTheNewestImage) {
  placeLeft();
  begin();
  search_->side_view_reports.resize(1);
  search_->side_view_reports[0].used = true;
  setClock(0);
  process(withLeft(0));
  search_->T_O_C.t.x() += 1;  // the object goes 0.1 m to the left in 0.1 s
  setClock(0.1);
  const FrameResult result = process(withLeft(0.1));
  ASSERT_TRUE(result.pose && result.twist);
  EXPECT_NEAR(result.pose->header.stamp.toSec(), 1000.105, 1e-6);
  EXPECT_NEAR(result.pose->pose.pose.position.x, -0.1 - 0.005, 1e-6);
  EXPECT_EQ(result.twist->header.stamp, result.pose->header.stamp);
  EXPECT_NEAR(result.status.header.stamp.toSec(), 1000.1, 1e-6) << "the image's";
  search_->side_view_reports[0].used = false;
  setClock(0.2);
  EXPECT_NEAR(process(withLeft(0.2)).pose->header.stamp.toSec(), 1000.2, 1e-6);
}

TEST_F(MessageTrackerCamerasTest, AnotherCameraLeadsWhereTheFirstOneFails) {
  placeLeft();
  begin();
  setClock(0);
  process(withLeft(0));
  CameraFrame frame = frameAt(0.1, "left_camera");
  frame.camera = 1;
  frame.side_views = {{}, {nullptr, nullptr, "no image comes"}};
  search_->T_O_C.t = {-4, 0, -1};  // where the object is for the left camera
  setClock(0.1);
  const FrameResult result = process(frame);
  EXPECT_EQ(search_->side_views.size(), 0u);
  EXPECT_EQ(int{result.status.cameras}, 1);
  EXPECT_EQ(result.status.cameras_used, "left/image_raw");
  ASSERT_EQ(result.views.size(), 1u);
  EXPECT_EQ(result.views[0].camera, 1u);
  EXPECT_EQ(result.status.cameras_message,
            "image: no image comes; right/image_raw: no image comes");
  ASSERT_TRUE(result.pose);
  EXPECT_EQ(result.pose->header.frame_id, "camera") << "as before";
  EXPECT_NEAR(result.pose->pose.pose.position.x, 0, 1e-6);
  // The search began where the object was, seen from there.
  EXPECT_NEAR(search_->priors.back().T_O_C.t.x(), -4, 1e-6);
}

TEST_F(MessageTrackerCamerasTest, SaysThatOthersFoundTheObject) {
  placeLeft();
  search_->own_sees = false;
  search_->side_view_reports.resize(1);
  search_->side_view_reports[0].used = true;
  const FrameResult result = processFirst(withLeft());
  EXPECT_EQ(int{result.status.cameras}, 1);
  EXPECT_EQ(result.status.cameras_used, "left/image_raw");
  EXPECT_NE(result.status.cameras_message.find("image: its image does not show"),
            std::string::npos);
}

/// The left camera stands 3 mm beside where TF has it.
TEST_F(MessageTrackerCamerasTest, CalibratesACameraFromWhatWasTracked) {
  placeLeft();
  begin();
  const Pose T_C_V(Eigen::Matrix3d::Identity(), {-0.4, 0.003, 0});
  search_->covariance = covarianceOf(0.001, 0.002);  // of the model's unit, 0.1 m
  search_->side_view_reports.resize(1);
  Pose stated;
  EXPECT_EQ(tracker_->calibrate(1, {}, &stated).sightings, 0);
  for (int i = 0; i < 30; ++i) {
    const Pose T_C_U(expSO3({0.3 * (i % 5), 0.5 * (i % 3), 0.2 * i}),
                     {0.05 * (i % 4) - 0.1, 0.06 * (i % 3) - 0.06, 0.4 + 0.05 * (i % 7)});
    Pose T_O_C = T_C_U.inverse();
    T_O_C.t /= 0.1;
    search_->T_O_C = T_O_C;
    SideViewReport& report = search_->side_view_reports[0];
    report.score = 0.9;
    report.T_V_O = T_C_V.inverse() * T_C_U;
    report.covariance = covarianceOf(0.001, 0.0002);
    setClock(0.1 * i);
    tracker_->process(withLeft(0.1 * i));
  }
  const CameraCalibration found = tracker_->calibrate(1, {}, &stated);
  EXPECT_TRUE(found.success) << found.message;
  EXPECT_GE(found.sightings, 20);
  EXPECT_NEAR(stated.t.y(), 0, 1e-9);
  EXPECT_NEAR((found.T_C_V.t - T_C_V.t).norm(), 0, 1e-4);
  EXPECT_THROW(tracker_->calibrate(7, {}, &stated), std::exception);
}

/// A camera in the hand, and a frame in which the object stands still.
class MessageTrackerWindowTest : public MessageTrackerTest {
 protected:
  MessageTrackerWindowTest() {
    parameters_.frames.fixed_frame = "base";
    parameters_.tracker.window.views = 3;
    restart();
  }

  /// The camera stands so far beside the object, and sees it there.
  void processAt(double seconds, double x) {
    addTransform("base", "camera", seconds, x);
    search_->T_O_C.t = {x / 0.1, 0, -4};
    setClock(seconds);
    last_ = tracker_->process(frameAt(seconds));
    ASSERT_TRUE(last_);
  }

  std::optional<FrameResult> last_;
};

TEST_F(MessageTrackerWindowTest, PastImagesActAsFurtherCameras) {
  useModel();
  offer();
  processAt(0, 0);
  EXPECT_EQ(search_->side_views.size(), 0u);
  processAt(0.1, 0.01);
  EXPECT_EQ(search_->side_views.size(), 0u) << "from the same side";
  search_->side_view_reports.resize(1);
  search_->side_view_reports[0].used = true;
  processAt(0.2, 0.15);
  ASSERT_EQ(search_->side_views.size(), 1u);
  EXPECT_EQ(search_->side_views[0].camera, 0);
  EXPECT_NEAR(search_->side_views[0].T_C_V.t.x(), -0.15, 1e-9);
  EXPECT_EQ(int{last_->status.window}, 1);
  EXPECT_EQ(int{last_->status.cameras}, 1);
}

TEST_F(MessageTrackerWindowTest, NoneActWhereTransformsAreMissing) {
  useModel();
  offer();
  processAt(0, 0);
  setClock(0.2);
  last_ = tracker_->process(frameAt(5));
  EXPECT_EQ(search_->side_views.size(), 0u);
}

}  // namespace
}  // namespace nerf_pose_refiner
