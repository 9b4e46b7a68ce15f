// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Many images, faster than they can be refined: the newest is next, every image is accounted for,
// also those that queues of roscpp drop, and the memory stays as it is. scripts/soak does more for
// longer.
#include <diagnostic_msgs/DiagnosticArray.h>
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
#include <map>
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
#include "support/resident_memory.h"
#include "support/scene_dataset.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kMetresPerUnit = 0.1;
constexpr double kRate_hz = 60;

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

/// What has become of the images, as the node says on /diagnostics.
using Counts = std::map<std::string, long>;

/// Those that arrived, or were lost before by the numbers in their headers.
long sentBy(const Counts& counts) {
  return counts.at("arrived images") + counts.at("images lost before");
}

/// Whether each image with camera_info has come to its end.
bool allEnded(const Counts& counts) {
  return counts.at("refined images") + counts.at("dropped images") + counts.at("refused images") +
             counts.at("skipped images") ==
         counts.at("images with camera_info");
}

class SoakTest : public testing::Test {
 protected:
  SoakTest()
      : pnh_("pose_refiner"),
        root_(ros::param::param<std::string>("pose_refiner/dataset_root", "")),
        scene_(makeAnalyticScene()),
        T_O_C_(cameraAround(*scene_, 0.7, 0.5)),
        initial_pose_(pnh_.advertise<geometry_msgs::PoseStamped>("initial_pose", 5)),
        diagnostics_(nh_, "/diagnostics"),
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

  /// The newest counts; empty: there are none yet.
  Counts counts() const {
    Counts counts;
    for (const diagnostic_msgs::DiagnosticArray& report : diagnostics_.all()) {
      for (const diagnostic_msgs::DiagnosticStatus& part : report.status) {
        if (part.name.find(": tracking") == std::string::npos) continue;
        for (const diagnostic_msgs::KeyValue& value : part.values) {
          if (value.key.find("images") != std::string::npos) {
            counts[value.key] = std::stol(value.value);
          }
        }
      }
    }
    return counts;
  }

  /// Stops the camera, and waits until all images have come to their end, and `sent` more of them
  /// than at the `start`. @return counts that are so, or the last ones.
  Counts settled(const Counts& start = {}, long sent = 0) {
    camera_->pause(true);
    diagnostics_.clear();
    Counts before, now;
    waitUntil([&] {
      const Counts newest = counts();
      if (newest.empty()) return false;
      diagnostics_.clear();
      before = std::exchange(now, newest);
      return now == before && allEnded(now) &&
             (start.empty() || sentBy(now) - sentBy(start) == sent);
    });
    return now;
  }

  std::vector<RefinementStatus> refined() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return refined_;
  }

  RefinementStatus last() const {
    std::lock_guard<std::mutex> lock(mutex_);
    return refined_.empty() ? RefinementStatus() : refined_.back();
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
    if (status.latency_s > 0) refined_.push_back(status);
  }

  mutable std::mutex mutex_;  ///< guards refined_
  std::vector<RefinementStatus> refined_;
  Listener<diagnostic_msgs::DiagnosticArray> diagnostics_;
  ros::Subscriber status_;  ///< last: it calls back
};

/// Refined images that are not newer than the one before.
int countOld(const std::vector<RefinementStatus>& refined) {
  int old = 0;
  for (std::size_t i = 1; i < refined.size(); ++i) {
    if (refined[i].header.stamp <= refined[i - 1].header.stamp) ++old;
  }
  return old;
}

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

double medianLatency(const std::vector<RefinementStatus>& refined) {
  std::vector<double> latencies;
  for (const RefinementStatus& status : refined) latencies.push_back(status.latency_s);
  return median(latencies);
}

/// How old images are when the node gets them: an image waits in no queue while a newer one comes.
double medianAgeOnArrival(const std::vector<RefinementStatus>& refined) {
  std::vector<double> ages;
  for (const RefinementStatus& status : refined) {
    ages.push_back(status.image_age_s - status.latency_s);
  }
  return median(ages);
}

TEST_F(SoakTest, TheNewestIsNextAndMemoryIsFlat) {
  const auto frames = static_cast<std::size_t>(ros::param::param("soak/frames", 500));
  ASSERT_NO_FATAL_FAILURE(learn());
  ASSERT_NO_FATAL_FAILURE(startCamera());
  const int pid = pidOf("pose_refiner");
  ASSERT_GT(residentMiB(pid), 0);
  sendInitialPose();
  ASSERT_TRUE(waitUntil([&] { return refined().size() > 10; }));

  const Counts counts_before = settled();
  ASSERT_FALSE(counts_before.empty());
  const RefinementStatus begin = last();
  const std::size_t taken_before = camera_->stamps().size();
  camera_->pause(false);
  sendInitialPose();  // the pause may have been longer than ~recover_s
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
  const double memory_after = residentMiB(pid);
  camera_->pause(true);
  const long sent = static_cast<long>(camera_->stamps().size() - taken_before);
  Counts counts = settled(counts_before, sent);
  const std::vector<RefinementStatus> all = refined();

  EXPECT_EQ(sentBy(counts) - sentBy(counts_before), sent);
  EXPECT_TRUE(allEnded(counts)) << testing::PrintToString(counts);
  for (const auto& [name, count] : counts) {
    std::printf("%s: %ld\n", name.c_str(), count - counts_before.at(name));
  }
  EXPECT_GT(counts["refined images"], counts_before.at("refined images") + 10);
  EXPECT_EQ(countOld(all), 0);
  EXPECT_LT(medianAgeOnArrival(all), 1 / kRate_hz);
  std::printf("memory: %.1f MiB at the start, %.1f after a fifth, %.1f at the end\n", memory_before,
              memory_warm, memory_after);
  if (!kSanitized) {
    EXPECT_LT(memory_after - memory_warm, 8) << "MiB";
  }
  EXPECT_EQ(int{last().state}, int{RefinementStatus::STATE_TRACKING});
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
