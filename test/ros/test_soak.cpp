// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Many images, faster than they can be refined: the newest is next, the others are counted, and the
// memory stays as it is. scripts/soak runs it for long.
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <nerf_pose_refiner/RefinementStatus.h>
#include <nerf_pose_refiner/RegisterObject.h>
#include <ros/network.h>
#include <ros/ros.h>
#include <xmlrpcpp/XmlRpcClient.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "backend/loaded_field.h"
#include "fake_camera.h"
#include "field/object_frame.h"
#include "graph.h"
#include "image/colour.h"
#include "ros/conversions/camera_input.h"
#include "ros/conversions/pose_conversions.h"
#include "support/analytic_scene.h"
#include "support/scene_dataset.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kMetresPerUnit = 0.1;
constexpr double kRate_hz = 60;
constexpr double kSlack_s = 0.1;  // for what scheduling delays on a machine that is busy

/// Process id of a node, by its XML-RPC interface.
int pidOf(const std::string& node) {
  XmlRpc::XmlRpcValue arguments, response, payload;
  arguments[0] = ros::this_node::getName();
  arguments[1] = ros::names::resolve(node);
  if (!ros::master::execute("lookupNode", arguments, response, payload, true)) return 0;
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(static_cast<std::string&>(payload), host, port)) return 0;
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  XmlRpc::XmlRpcValue caller, answer;
  caller[0] = ros::this_node::getName();
  if (!client.execute("getPid", caller, answer)) return 0;
  return static_cast<int&>(answer[2]);
}

/// Memory of a process that is in RAM [MiB].
double residentMiB(int pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  for (std::string line; std::getline(status, line);) {
    if (line.rfind("VmRSS:", 0) == 0) return std::stod(line.substr(6)) / 1024;
  }
  return 0;
}

/// A refined image, and when its status came.
struct Refined {
  RefinementStatus status;
  ros::Time received;
};

class SoakTest : public testing::Test {
 protected:
  SoakTest()
      : pnh_("pose_refiner"),
        root_(ros::param::param<std::string>("pose_refiner/dataset_root", "")),
        scene_(makeAnalyticScene()),
        T_O_C_(cameraAround(*scene_, 0.7, 0.5)),
        initial_pose_(pnh_.advertise<geometry_msgs::PoseStamped>("initial_pose", 5)),
        status_(pnh_.subscribe("status", 1000, &SoakTest::onStatus, this)) {}

  ~SoakTest() override { std::filesystem::remove_all(root_); }

  void learn() {
    writeSceneDataset(*scene_, root_ + "/toy", 40, 48);
    ASSERT_TRUE(ros::service::waitForService("pose_refiner/register_object", 30000));
    RegisterObject call;
    call.request.name = call.request.dataset = "toy";
    call.request.metres_per_unit = kMetresPerUnit;
    ASSERT_TRUE(ros::service::call("pose_refiner/register_object", call));
    ASSERT_TRUE(call.response.success) << call.response.message;
  }

  void startCamera() {
    const Observation view = observeScene(*scene_, squareCamera(96), T_O_C_);
    const Image8 picture = toBytes(composite({view.image, view.alpha}, {0.4f, 0.4f, 0.4f}));
    sensor_msgs::Image image;
    image.width = image.height = 96;
    image.encoding = "rgb8";
    image.step = 3 * 96;
    image.data = picture.values;
    sensor_msgs::CameraInfo info = toMessage(view.camera);
    image.header.frame_id = info.header.frame_id = "camera_optical";
    camera_ = std::make_unique<FakeCamera>(
        nh_, image, info, std::chrono::microseconds(static_cast<int>(1e6 / kRate_hz)));
    ASSERT_TRUE(waitUntil([&] { return camera_->connected(); }));
  }

  void sendInitialPose() {
    geometry_msgs::PoseStamped pose;
    pose.header.frame_id = "camera_optical";
    pose.pose = toMessage(ObjectFrame(Pose(), kMetresPerUnit).objectInCamera(T_O_C_));
    initial_pose_.publish(pose);
  }

  std::vector<Refined> refined() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return refined_;
  }

  RefinementStatus last() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return refined_.empty() ? RefinementStatus() : refined_.back().status;
  }

  ros::NodeHandle nh_;
  ros::NodeHandle pnh_;
  std::string root_;
  std::shared_ptr<const LoadedField> scene_;
  Pose T_O_C_;
  ros::Publisher initial_pose_;
  std::unique_ptr<FakeCamera> camera_;

 private:
  void onStatus(const RefinementStatus& status) {
    std::lock_guard<std::mutex> lock(mutex_);
    if (status.latency_s > 0) refined_.push_back({status, ros::Time::now()});
  }

  mutable std::mutex mutex_;  ///< guards refined_
  std::vector<Refined> refined_;
  ros::Subscriber status_;  ///< last: it calls back
};

/// Refinements that began although a newer image had come by then.
int countStale(const std::vector<Refined>& refined, const std::set<ros::Time>& stamps) {
  int stale = 0;
  for (std::size_t i = 1; i < refined.size(); ++i) {
    // It began after the one before was done; what was taken well before that had come.
    const ros::Time begun = refined[i - 1].received - ros::Duration(kSlack_s);
    const auto newer = stamps.upper_bound(refined[i].status.header.stamp);
    if (newer != stamps.end() && *newer < begun) ++stale;
  }
  return stale;
}

double medianLatency(const std::vector<Refined>& refined) {
  std::vector<float> latencies;
  for (const Refined& r : refined) latencies.push_back(r.status.latency_s);
  const auto middle = latencies.begin() + static_cast<std::ptrdiff_t>(latencies.size() / 2);
  std::nth_element(latencies.begin(), middle, latencies.end());
  return *middle;
}

TEST_F(SoakTest, TheNewestIsNextAndMemoryIsFlat) {
  const auto frames = static_cast<std::size_t>(ros::param::param("soak/frames", 500));
  ASSERT_NO_FATAL_FAILURE(learn());
  ASSERT_NO_FATAL_FAILURE(startCamera());
  const int pid = pidOf("pose_refiner");
  ASSERT_GT(residentMiB(pid), 0);
  sendInitialPose();
  ASSERT_TRUE(waitUntil([&] { return refined().size() > 10; }));

  const RefinementStatus begin = last();
  const std::size_t taken_before = camera_->stamps().size();
  const double memory_before = residentMiB(pid);
  double memory_warm = 0;
  std::printf("%8s %8s %8s %12s %14s\n", "images", "refined", "dropped", "memory [MiB]",
              "latency [ms]");
  for (std::size_t tenth = 1; tenth <= 10; ++tenth) {
    const std::size_t wanted = taken_before + frames * tenth / 10;
    while (camera_->stamps().size() < wanted) ros::WallDuration(0.02).sleep();
    const RefinementStatus now = last();
    if (tenth == 2) memory_warm = residentMiB(pid);
    std::printf("%8zu %8u %8u %12.1f %14.1f\n", frames * tenth / 10,
                now.processed - begin.processed, now.dropped - begin.dropped, residentMiB(pid),
                1e3 * medianLatency(refined()));
    std::fflush(stdout);
  }
  const RefinementStatus end = last();
  const std::vector<Refined> all = refined();
  const std::set<ros::Time> stamps = camera_->stamps();
  const double memory_after = residentMiB(pid);

  // Each image is refined or counted as dropped; some are on their way.
  const auto of_interest = static_cast<std::size_t>(
      std::distance(stamps.upper_bound(begin.header.stamp), stamps.upper_bound(end.header.stamp)));
  const std::size_t accounted = end.processed - begin.processed + end.dropped - begin.dropped;
  EXPECT_NEAR(static_cast<double>(accounted), static_cast<double>(of_interest),
              3 + 0.01 * static_cast<double>(frames));
  const int stale = countStale(all, stamps);
  std::printf("%d of %zu refinements were of an image that was not the newest\n", stale,
              all.size());
  EXPECT_LE(stale, 1 + static_cast<int>(all.size() / 100));
  std::printf("memory: %.1f MiB at the start, %.1f after a fifth, %.1f at the end\n", memory_before,
              memory_warm, memory_after);
  EXPECT_LT(memory_after - memory_warm, 8) << "MiB";
  EXPECT_EQ(int{end.state}, int{RefinementStatus::STATE_TRACKING});
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "soak");
  const ros::NodeHandle keep_alive;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
