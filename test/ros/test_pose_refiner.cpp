// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// The whole way in a ROS graph, as a node and as a nodelet: photos to a model, an image and a rough
// pose to a refined one, and all that may go wrong on it. Tests called Nodelet... are for that
// alone.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <gtest/gtest.h>
#include <nerf_pose_refiner/LoadObject.h>
#include <nerf_pose_refiner/PoseHypothesisArray.h>
#include <nerf_pose_refiner/RefinementStatus.h>
#include <nerf_pose_refiner/RegisterObject.h>
#include <nodelet/NodeletLoad.h>
#include <nodelet/NodeletUnload.h>
#include <ros/ros.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <tf2_msgs/TFMessage.h>

#include <cmath>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <string>

#include "fake_camera.h"
#include "graph.h"
#include "nerf_pose_refiner/image/colour.h"
#include "nerf_pose_refiner/ros/camera_input.h"
#include "nerf_pose_refiner/ros/pose_conversions.h"
#include "support/analytic_scene.h"
#include "support/scene_dataset.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;
using Status = RefinementStatus;

constexpr char kFrame[] = "camera_optical";
constexpr double kMetresPerUnit = 0.1;  // the object is 0.1 m across

/// What all tests share: the folders, the scene, the camera before it, and ears on each topic.
struct World {
  World()
      : pnh("pose_refiner"),
        root(ros::param::param<std::string>("pose_refiner/dataset_root", "")),
        engine(makeCpuEngine()),
        scene(makeAnalyticScene()),
        T_O_C(cameraAround(*scene, 0.7, 0.5)),
        initial_pose(pnh.advertise<geometry_msgs::PoseStamped>("initial_pose", 5)),
        poses(pnh, "pose"),
        status(pnh, "status"),
        hypotheses(pnh, "hypotheses"),
        transforms(nh, "/tf") {
    writeSceneDataset(engine.get(), *scene, root + "/toy", 40, 48);
    // The photo behind the object is grey, and known to nobody.
    const Observation view = observeScene(engine.get(), *scene, squareCamera(96), T_O_C);
    const Image8 picture = toBytes(composite({view.image, view.alpha}, {0.4f, 0.4f, 0.4f}));
    sensor_msgs::Image image;
    image.width = image.height = 96;
    image.encoding = "rgb8";
    image.step = 3 * 96;
    image.data = picture.values;
    sensor_msgs::CameraInfo info = toMessage(view.camera);
    image.header.frame_id = info.header.frame_id = kFrame;
    camera = std::make_unique<FakeCamera>(nh, image, info);
  }

  Pose truth() const { return objectInCamera(T_O_C, kMetresPerUnit); }

  ros::NodeHandle nh;
  ros::NodeHandle pnh;
  std::string root;
  std::shared_ptr<Engine> engine;
  std::shared_ptr<const LoadedField> scene;
  Pose T_O_C;
  std::unique_ptr<FakeCamera> camera;
  ros::Publisher initial_pose;
  Listener<geometry_msgs::PoseStamped> poses;
  Listener<RefinementStatus> status;
  Listener<PoseHypothesisArray> hypotheses;
  Listener<tf2_msgs::TFMessage> transforms;
};

std::unique_ptr<World> world;

RegisterObject registerObject(const std::string& name, const std::string& dataset,
                              double metres_per_unit) {
  RegisterObject call;
  call.request.name = name;
  call.request.dataset = dataset;
  call.request.metres_per_unit = metres_per_unit;
  EXPECT_TRUE(world->pnh.serviceClient<RegisterObject>("register_object").call(call));
  return call;
}

LoadObject loadObject(const std::string& name) {
  LoadObject call;
  call.request.name = name;
  EXPECT_TRUE(world->pnh.serviceClient<LoadObject>("load_object").call(call));
  return call;
}

/// A pose that is off by 6 degrees and 6 % of the diameter.
geometry_msgs::PoseStamped roughPose() {
  Pose pose = world->truth();
  pose.R = expSO3({0.06, -0.08, 0.03}) * pose.R;
  pose.t += Eigen::Vector3d(0.004, -0.003, 0.003);
  geometry_msgs::PoseStamped message;
  message.header.frame_id = kFrame;
  message.pose = toMessage(pose);
  return message;
}

class PoseRefinerTest : public testing::Test {
 protected:
  static void SetUpTestSuite() {
    world = std::make_unique<World>();
    ASSERT_TRUE(ros::service::waitForService("pose_refiner/register_object", 30000));
    ASSERT_TRUE(waitUntil([] {
      return world->camera->connected() && world->initial_pose.getNumSubscribers() > 0 &&
             world->poses.connected() && world->status.connected() &&
             world->hypotheses.connected() && world->transforms.connected();
    }));
    const RegisterObject call = registerObject("toy", "toy", kMetresPerUnit);
    ASSERT_TRUE(call.response.success) << call.response.message;
    EXPECT_FALSE(call.response.loaded_existing);
    EXPECT_GT(call.response.psnr_db, 20);
    EXPECT_GT(call.response.seconds, 0);
  }

  static void TearDownTestSuite() {
    const std::string root = world->root;
    world.reset();
    fs::remove_all(root);
  }

  void SetUp() override {
    std_srvs::Trigger reset;
    ASSERT_TRUE(world->pnh.serviceClient<std_srvs::Trigger>("reset").call(reset));
    ASSERT_TRUE(waitUntil([] {
      const auto last = world->status.last();
      return last && last->reason == Status::REASON_RESET;
    }));
    world->poses.clear();
    world->status.clear();
    world->hypotheses.clear();
    world->transforms.clear();
  }

  static bool waitForReason(int reason) {
    return world->status.wait([&](const RefinementStatus& s) { return s.reason == reason; })
        .has_value();
  }

  static bool waitForState(int state) {
    return world->status.wait([&](const RefinementStatus& s) { return s.state == state; })
        .has_value();
  }

  /// Sends an initial pose and waits for a refined one.
  static std::optional<geometry_msgs::PoseStamped> track() {
    world->initial_pose.publish(roughPose());
    return world->poses.wait();
  }

  static void expectTruth(const geometry_msgs::PoseStamped& message) {
    const Pose pose = fromMessage(message.pose);
    const Pose truth = world->truth();
    EXPECT_LT(rotationDistance(pose.R, truth.R) * 180 / M_PI, 2);
    EXPECT_LT((pose.t - truth.t).norm(), 0.004) << pose.t.transpose();
    EXPECT_EQ(message.header.frame_id, kFrame);
    EXPECT_TRUE(world->camera->took(message.header.stamp));
  }
};

TEST_F(PoseRefinerTest, RefinesARoughPose) {
  const auto pose = track();
  ASSERT_TRUE(pose);
  expectTruth(*pose);
  const auto status = world->status.wait([&](const RefinementStatus& s) {
    return s.header.stamp == pose->header.stamp && s.score > 0;
  });
  ASSERT_TRUE(status);
  EXPECT_EQ(int{status->state}, int{Status::STATE_TRACKING});
  EXPECT_EQ(int{status->reason}, int{Status::REASON_NONE}) << status->message;
  EXPECT_EQ(status->header.frame_id, kFrame);
  EXPECT_EQ(status->object, "toy");
  EXPECT_LE(status->score, 1);
  EXPECT_GT(status->latency_s, 0);
  EXPECT_GE(status->image_age_s, 0);
  EXPECT_TRUE(waitForState(Status::STATE_REFINING));
  const auto hypotheses = world->hypotheses.wait();
  ASSERT_TRUE(hypotheses);
  EXPECT_EQ(hypotheses->header.stamp, pose->header.stamp);
  EXPECT_EQ(hypotheses->object, "toy");
  EXPECT_FALSE(hypotheses->hypotheses.empty());
}

TEST_F(PoseRefinerTest, FollowsAndSendsOneTransformForEachImage) {
  ASSERT_TRUE(track());
  ASSERT_TRUE(waitUntil([] { return world->poses.all().size() >= 5; }));
  // TF and the poses travel apart: look at what both have.
  std::map<ros::Time, int> transforms;
  ASSERT_TRUE(waitUntil([&] {
    transforms.clear();
    for (const tf2_msgs::TFMessage& message : world->transforms.all()) {
      for (const geometry_msgs::TransformStamped& transform : message.transforms) {
        EXPECT_EQ(transform.header.frame_id, kFrame);
        EXPECT_EQ(transform.child_frame_id, "toy");
        ++transforms[transform.header.stamp];
      }
    }
    return transforms.size() >= 5;
  }));
  for (const auto& entry : transforms) EXPECT_EQ(entry.second, 1) << entry.first;
  std::map<ros::Time, int> poses;
  for (const geometry_msgs::PoseStamped& pose : world->poses.all()) {
    expectTruth(pose);
    EXPECT_EQ(++poses[pose.header.stamp], 1);
  }
}

TEST_F(PoseRefinerTest, DrawsAnOverlayForWhoLooks) {
  Listener<sensor_msgs::Image> images(world->pnh, "overlay/image_raw");
  Listener<sensor_msgs::CameraInfo> infos(world->pnh, "overlay/camera_info");
  ASSERT_TRUE(track());
  const auto image = images.wait();
  ASSERT_TRUE(image);
  EXPECT_EQ(image->header.frame_id, kFrame);
  EXPECT_TRUE(world->camera->took(image->header.stamp));
  EXPECT_EQ(image->encoding, "rgb8");
  const auto info = infos.wait(
      [&](const sensor_msgs::CameraInfo& i) { return i.header.stamp == image->header.stamp; });
  ASSERT_TRUE(info);
  EXPECT_EQ(info->header.frame_id, kFrame);
  EXPECT_EQ(info->width, image->width);
  EXPECT_GT(info->P[0], 0);
}

TEST_F(PoseRefinerTest, SaysWhyAnInitialPoseIsRefused) {
  geometry_msgs::PoseStamped pose = roughPose();
  pose.pose.position.x = std::numeric_limits<double>::quiet_NaN();
  world->initial_pose.publish(pose);
  EXPECT_TRUE(waitForReason(Status::REASON_PRIOR_NOT_FINITE));
  pose = roughPose();
  pose.pose.orientation.w += 1;
  world->initial_pose.publish(pose);
  EXPECT_TRUE(waitForReason(Status::REASON_PRIOR_NOT_UNIT));
  pose = roughPose();
  pose.header.frame_id = "no_such_frame";
  world->initial_pose.publish(pose);
  EXPECT_TRUE(waitForReason(Status::REASON_PRIOR_NO_FRAME));
  pose = roughPose();
  pose.header.stamp = ros::Time::now() - ros::Duration(3600);
  world->initial_pose.publish(pose);
  EXPECT_TRUE(waitForReason(Status::REASON_PRIOR_TOO_OLD));
  pose.header.stamp = ros::Time::now() + ros::Duration(3600);
  world->initial_pose.publish(pose);
  EXPECT_TRUE(waitForReason(Status::REASON_PRIOR_IN_FUTURE));
  EXPECT_TRUE(world->poses.all().empty());
  EXPECT_TRUE(track());
}

TEST_F(PoseRefinerTest, OutlivesImagesThatItCannotUse) {
  sensor_msgs::Image image;
  sensor_msgs::CameraInfo info;
  world->camera->change([&](sensor_msgs::Image* i, sensor_msgs::CameraInfo* c) {
    image = *i;
    info = *c;
    c->K[0] = 0;
  });
  EXPECT_TRUE(waitForReason(Status::REASON_UNCALIBRATED));
  world->camera->change([&](sensor_msgs::Image* i, sensor_msgs::CameraInfo* c) {
    *c = info;
    i->encoding = "32FC1";
  });
  EXPECT_TRUE(waitForReason(Status::REASON_BAD_IMAGE));
  world->camera->change([&](sensor_msgs::Image* i, sensor_msgs::CameraInfo*) {
    *i = image;
    i->height = 48;
    i->data.resize(i->step * 48);
  });
  EXPECT_TRUE(waitForReason(Status::REASON_BAD_CAMERA_INFO));
  // Another size that fits together, while it tracks: the upper half of the picture.
  world->camera->change([&](sensor_msgs::Image* i, sensor_msgs::CameraInfo*) { *i = image; });
  EXPECT_TRUE(track());
  world->status.clear();
  world->camera->change([&](sensor_msgs::Image* i, sensor_msgs::CameraInfo* c) {
    i->height = c->height = 48;
    i->data.resize(i->step * 48);
  });
  EXPECT_TRUE(world->status.wait([](const RefinementStatus& s) { return s.processed > 0; }));
  world->camera->change([&](sensor_msgs::Image* i, sensor_msgs::CameraInfo* c) {
    *i = image;
    *c = info;
  });
}

TEST_F(PoseRefinerTest, ForgetsAllWhenTimeGoesBack) {
  ASSERT_TRUE(track());
  world->status.clear();
  world->camera->shiftTime(-100);
  EXPECT_TRUE(waitForReason(Status::REASON_CLOCK_JUMPED));
  world->poses.clear();
  const auto pose = track();
  ASSERT_TRUE(pose);
  expectTruth(*pose);
  EXPECT_LT(pose->header.stamp, ros::Time::now() - ros::Duration(50));
  world->camera->shiftTime(0);
}

TEST_F(PoseRefinerTest, StopsAndGoesOnRequest) {
  ASSERT_TRUE(track());
  std_srvs::SetBool enable;
  ASSERT_TRUE(world->pnh.serviceClient<std_srvs::SetBool>("enable").call(enable));
  EXPECT_TRUE(waitForReason(Status::REASON_DISABLED));
  EXPECT_TRUE(waitUntil([] { return !world->camera->connected(); })) << "images cost time to carry";
  enable.request.data = true;
  ASSERT_TRUE(world->pnh.serviceClient<std_srvs::SetBool>("enable").call(enable));
  EXPECT_TRUE(waitUntil([] { return world->camera->connected(); }));
  world->poses.clear();
  EXPECT_TRUE(track());
}

TEST_F(PoseRefinerTest, RefusesPathsOutOfItsFolders) {
  const fs::path root = world->root;
  fs::create_directory_symlink(root.parent_path(), root / "up");
  const std::string name = root.filename().string();
  for (const std::string& dataset :
       {"../" + name + "/toy", (root / "toy").string(), std::string("up"), std::string()}) {
    const RegisterObject call = registerObject("thief", dataset, kMetresPerUnit);
    EXPECT_FALSE(call.response.success) << dataset;
    EXPECT_FALSE(call.response.message.empty());
  }
  EXPECT_FALSE(registerObject("../thief", "toy", kMetresPerUnit).response.success);
  EXPECT_FALSE(loadObject("../toy").response.success);
  EXPECT_FALSE(loadObject((root / "models" / "toy").string()).response.success);
  EXPECT_FALSE(fs::exists(root / "thief.safetensors"));
  EXPECT_TRUE(track()) << "the object in use stays";
}

TEST_F(PoseRefinerTest, SaysWhatIsMissing) {
  RegisterObject call = registerObject("other", "no_such_folder", kMetresPerUnit);
  EXPECT_FALSE(call.response.success);
  EXPECT_NE(call.response.message.find("no_such_folder"), std::string::npos);
  call = registerObject("other", "toy", 0);
  EXPECT_FALSE(call.response.success);
  EXPECT_NE(call.response.message.find("metres_per_unit"), std::string::npos);
  const LoadObject load = loadObject("no_such_object");
  EXPECT_FALSE(load.response.success);
  EXPECT_NE(load.response.message.find("no_such_object"), std::string::npos);
}

TEST_F(PoseRefinerTest, LearnsNothingTwice) {
  ASSERT_TRUE(track());
  const RegisterObject call = registerObject("toy", "toy", kMetresPerUnit);
  EXPECT_TRUE(call.response.success) << call.response.message;
  EXPECT_TRUE(call.response.loaded_existing);
  const LoadObject load = loadObject("toy");
  EXPECT_TRUE(load.response.success) << load.response.message;
  world->poses.clear();
  EXPECT_TRUE(track()) << "in use when the service returns";
}

TEST_F(PoseRefinerTest, ReportsDiagnostics) {
  Listener<diagnostic_msgs::DiagnosticArray> diagnostics(world->nh, "/diagnostics");
  const auto report = diagnostics.wait([](const diagnostic_msgs::DiagnosticArray& array) {
    return !array.status.empty() && array.status[0].name.find("pose_refiner") != std::string::npos;
  });
  ASSERT_TRUE(report);
  std::map<std::string, std::string> values;
  for (const auto& entry : report->status[0].values) values[entry.key] = entry.value;
  EXPECT_EQ(values["object"], "toy");
  EXPECT_EQ(values.count("latency [s]"), 1u);
  EXPECT_EQ(values.count("dropped images"), 1u);
}

bool loadNodelet(const std::string& name) {
  nodelet::NodeletLoad load;
  load.request.name = name;
  load.request.type = "nerf_pose_refiner/PoseRefiner";
  load.request.remap_source_args = {"image"};
  load.request.remap_target_args = {"camera/image_raw"};
  return ros::service::call("manager/load_nodelet", load) && load.response.success;
}

TEST_F(PoseRefinerTest, NodeletDoesNotStartWithAParameterThatIsNone) {
  ros::param::set("second/tracker/min_scroe", 0.5);
  EXPECT_FALSE(loadNodelet("/second"));
  ros::param::del("second/tracker/min_scroe");
  ros::param::set("second/tracker/min_score", 1.5);
  EXPECT_FALSE(loadNodelet("/second"));
  EXPECT_TRUE(track()) << "the manager and the first one live on";
}

TEST_F(PoseRefinerTest, NodeletIsUnloadedAndLoadedWhileItRefines) {
  ros::param::set("pose_refiner/object", "toy");
  for (int i = 0; i < 3; ++i) {
    world->initial_pose.publish(roughPose());
    ASSERT_TRUE(waitForState(Status::STATE_REFINING));
    nodelet::NodeletUnload unload;
    unload.request.name = "/pose_refiner";
    ASSERT_TRUE(ros::service::call("manager/unload_nodelet", unload));
    ASSERT_TRUE(unload.response.success);
    ASSERT_TRUE(waitUntil([] {
      return !world->camera->connected() && world->initial_pose.getNumSubscribers() == 0;
    }));
    world->status.clear();
    ASSERT_TRUE(loadNodelet("/pose_refiner"));
    ASSERT_TRUE(waitForState(Status::STATE_WAITING)) << "the object is read by itself";
    ASSERT_TRUE(waitUntil(
        [] { return world->camera->connected() && world->initial_pose.getNumSubscribers() > 0; }));
    world->status.clear();
  }
  world->poses.clear();
  EXPECT_TRUE(track());
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::init(argc, argv, "test_pose_refiner");
  const ros::NodeHandle keep_alive;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
