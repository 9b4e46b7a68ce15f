// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Two cameras in a ROS graph: one is covered, falls silent, or has to do alone.
#include <gtest/gtest.h>
#include <nerf_pose_refiner/CalibrateCamera.h>
#include <tf2_msgs/TFMessage.h>

#include <algorithm>
#include <cstdlib>
#include <mutex>
#include <set>
#include <string>

#include "pose_refiner_graph.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kLater_s = 0.004;  // than the first camera's images

/// A camera 70 degrees beside the first one; takes an image shortly after each of that one's.
class SideTwin {
 public:
  explicit SideTwin(ros::NodeHandle nh)
      : images_(nh.advertise<sensor_msgs::Image>("side_camera/image", 10)),
        infos_(nh.advertise<sensor_msgs::CameraInfo>("side_camera/camera_info", 10)),
        transforms_(nh.advertise<tf2_msgs::TFMessage>("/tf_static", 1, true)) {
    const Pose T_O_V = cameraAround(*world->scene, 0.7 + 70 * M_PI / 180, 0.5);
    const Observation view = observeScene(*world->scene, squareCamera(96), T_O_V);
    const Image8 picture = toBytes(composite({view.image, view.alpha}, {0.4f, 0.4f, 0.4f}));
    image_.width = image_.height = 96;
    image_.encoding = "rgb8";
    image_.step = 3 * 96;
    image_.data = picture.values;
    info_ = toMessage(view.camera);
    Pose T_C_V = world->T_O_C.inverse() * T_O_V;
    T_C_V.t *= kMetresPerUnit;
    geometry_msgs::PoseStamped place;
    place.header.frame_id = kFrame;
    place.pose = toMessage(T_C_V);
    tf2_msgs::TFMessage message;
    message.transforms = {toTransform(place, "side_optical")};
    transforms_.publish(message);
    trigger_ = nh.subscribe("camera/camera_info", 10, &SideTwin::onInfo, this);
  }

  void take(const ros::Time& stamp) {
    std::lock_guard<std::mutex> lock(mutex_);
    if (silent_) return;
    sensor_msgs::Image image = image_;
    if (covered_) std::fill(image.data.begin(), image.data.end(), 90);
    image.header.stamp = info_.header.stamp = stamp;
    image.header.frame_id = info_.header.frame_id = "side_optical";
    stamps_.insert(stamp);
    infos_.publish(info_);
    images_.publish(image);
  }

  void cover(bool covered) {
    std::lock_guard<std::mutex> lock(mutex_);
    covered_ = covered;
  }

  void silence(bool silent) {
    std::lock_guard<std::mutex> lock(mutex_);
    silent_ = silent;
  }

  bool took(const ros::Time& stamp) const {
    std::lock_guard<std::mutex> lock(mutex_);
    return stamps_.count(stamp) > 0;
  }

 private:
  void onInfo(const sensor_msgs::CameraInfo& of_first) {
    take(of_first.header.stamp + ros::Duration(kLater_s));
  }

  ros::Publisher images_, infos_, transforms_;
  mutable std::mutex mutex_;  ///< guards all down to stamps_
  sensor_msgs::Image image_;
  sensor_msgs::CameraInfo info_;
  bool covered_ = false, silent_ = false;
  std::set<ros::Time> stamps_;
  ros::Subscriber trigger_;  ///< last: it calls back
};

class PoseRefinerCamerasTest : public PoseRefinerTest {
 protected:
  using Condition = std::function<bool(const RefinementStatus&)>;

  /// The next status of a refined image for which something holds.
  std::optional<RefinementStatus> waitForStatus(const Condition& holds) {
    status_.clear();
    return status_.wait([&](const RefinementStatus& s) { return s.latency_s > 0 && holds(s); });
  }

  std::string lastMessage() const {
    return status_.last() ? status_.last()->cameras_message : "no status";
  }

  void begin() {
    ASSERT_TRUE(ros::service::waitForService("rig/load_object", 30000));
    ASSERT_TRUE(waitUntil([&] {
      return status_.connected() && poses_.connected() && initial_pose_.getNumSubscribers() > 0;
    }));
    LoadObject load;
    load.request.name = "toy";
    ASSERT_TRUE(rig_.serviceClient<LoadObject>("load_object").call(load));
    ASSERT_TRUE(load.response.success) << load.response.message;
    initial_pose_.publish(roughPose());
  }

  ros::NodeHandle rig_{"rig"};
  Listener<RefinementStatus> status_{rig_, "status"};
  Listener<geometry_msgs::PoseStamped> poses_{rig_, "pose"};
  ros::Publisher initial_pose_ = rig_.advertise<geometry_msgs::PoseStamped>("initial_pose", 5);
  SideTwin twin_{world->nh};
};

TEST_F(PoseRefinerCamerasTest, EachMayFailAlone) {
  begin();
  const auto both = waitForStatus([](const auto& s) { return s.cameras == 2; });
  ASSERT_TRUE(both) << lastMessage();
  EXPECT_EQ(both->cameras_used, "image side_camera/image");
  EXPECT_EQ(both->cameras_message, "");
  poses_.clear();
  const auto pose = poses_.wait([&](const auto& p) { return twin_.took(p.header.stamp); });
  ASSERT_TRUE(pose) << "no pose at the stamp of the newer image";
  EXPECT_TRUE(world->camera->took(pose->header.stamp - ros::Duration(kLater_s)));
  EXPECT_EQ(pose->header.frame_id, kFrame);
  const Pose truth = world->truth();
  EXPECT_LT((fromMessage(pose->pose).t - truth.t).norm(), 0.004);

  twin_.cover(true);
  const auto covered = waitForStatus([](const auto& s) { return s.cameras == 1; });
  ASSERT_TRUE(covered);
  EXPECT_EQ(int{covered->state}, int{Status::STATE_TRACKING});
  EXPECT_EQ(covered->cameras_used, "image");
  EXPECT_NE(covered->cameras_message.find("side_camera/image: "), std::string::npos)
      << covered->cameras_message;
  twin_.cover(false);
  ASSERT_TRUE(waitForStatus([](const auto& s) { return s.cameras == 2; })) << lastMessage();

  twin_.silence(true);
  const auto silent = waitForStatus(
      [](const auto& s) { return s.cameras_message == "side_camera/image: no image comes"; });
  ASSERT_TRUE(silent) << lastMessage();
  EXPECT_EQ(int{silent->state}, int{Status::STATE_TRACKING});
}

TEST_F(PoseRefinerCamerasTest, DrawsAnOverlayOfTheOtherCameraForWhoLooks) {
  begin();
  ASSERT_TRUE(waitForStatus([](const auto& s) { return s.cameras == 2; })) << lastMessage();
  const std::string folder = "cameras/side_camera/image/overlay/";
  Listener<sensor_msgs::CameraInfo> infos(rig_, folder + "camera_info");
  Listener<sensor_msgs::Image> images(rig_, folder + "image_raw");
  ASSERT_TRUE(waitUntil([&] { return images.connected() && infos.connected(); }));
  const auto image = images.wait();
  ASSERT_TRUE(image);
  EXPECT_EQ(image->header.frame_id, "side_optical");
  EXPECT_TRUE(twin_.took(image->header.stamp)) << image->header.stamp;
  EXPECT_EQ(image->encoding, "rgb8");
  EXPECT_EQ(image->width, 96u);
  EXPECT_EQ(image->height, 96u);
  const auto info = infos.wait(
      [&](const sensor_msgs::CameraInfo& i) { return i.header.stamp == image->header.stamp; });
  ASSERT_TRUE(info);
  EXPECT_EQ(info->header.frame_id, "side_optical");
  EXPECT_EQ(info->width, 96u);
  EXPECT_GT(info->P[0], 0);
  int coloured = 0;  // the camera's image is grey, the object's rendering is not
  for (std::size_t i = 0; i < image->data.size(); i += 3) {
    coloured += std::abs(image->data[i] - image->data[i + 2]) > 40;
  }
  EXPECT_GT(coloured, 100);
  EXPECT_LT(coloured, 96 * 96 / 2);
}

TEST_F(PoseRefinerCamerasTest, CalibrationSaysWhatIsMissing) {
  begin();
  ASSERT_TRUE(waitForStatus([](const auto& s) { return s.cameras == 2; })) << lastMessage();
  ros::ServiceClient calibrate = rig_.serviceClient<CalibrateCamera>("calibrate");
  CalibrateCamera call;
  ASSERT_TRUE(calibrate.call(call));
  EXPECT_FALSE(call.response.success);
  EXPECT_NE(call.response.message.find("20 are needed"), std::string::npos)
      << call.response.message;
  call.request.camera = "nobody/image";
  ASSERT_TRUE(calibrate.call(call));
  EXPECT_NE(call.response.message.find("nobody/image"), std::string::npos);
  // One pose of an object that stands still.
  call.request.camera = "side_camera/image";
  call.request.min_poses = 1;
  ASSERT_TRUE(calibrate.call(call));
  EXPECT_EQ(call.response.poses, 1u);
  EXPECT_FALSE(call.response.unseen.empty());
  EXPECT_GT(call.response.covariance[0], 0);
}

TEST_F(PoseRefinerCamerasTest, TheSecondOneLeadsWhileTheFirstIsSilent) {
  begin();
  ASSERT_TRUE(waitForStatus([](const auto& s) { return s.cameras == 2; })) << lastMessage();
  Listener<sensor_msgs::Image> overlay(rig_, "overlay/image_raw");
  Listener<sensor_msgs::Image> its_own(rig_, "cameras/side_camera/image/overlay/image_raw");
  ASSERT_TRUE(waitUntil([&] { return overlay.connected() && its_own.connected(); }));
  const auto showsTheSecond = [](const Listener<sensor_msgs::Image>& listener) {
    const auto image = listener.last();
    return image && image->header.frame_id == "side_optical";
  };
  world->camera->pause(true);
  status_.clear();
  poses_.clear();
  std::optional<RefinementStatus> alone;
  const bool led = waitUntil([&] {
    twin_.take(ros::Time::now());
    const auto last = status_.last();
    if (last && last->cameras_used == "side_camera/image") alone = last;
    const auto pose = poses_.last();
    return alone && pose && twin_.took(pose->header.stamp) &&
           pose->header.stamp >= alone->header.stamp && showsTheSecond(overlay) &&
           showsTheSecond(its_own);
  });
  world->camera->pause(false);
  ASSERT_TRUE(led) << lastMessage();
  EXPECT_EQ(alone->cameras_message, "image: no image comes");
  EXPECT_EQ(int{alone->state}, int{Status::STATE_TRACKING});
  EXPECT_EQ(poses_.last()->header.frame_id, kFrame) << "as before";
  EXPECT_LT((fromMessage(poses_.last()->pose).t - world->truth().t).norm(), 0.006);
  ASSERT_TRUE(waitForStatus([](const auto& s) { return s.cameras == 2; })) << lastMessage();
}

}  // namespace
}  // namespace nerf_pose_refiner
