// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Registrations that go on and on, of the refiner /patient, which tracks meanwhile.
#include <actionlib/client/simple_action_client.h>
#include <gtest/gtest.h>
#include <nerf_pose_refiner/RegisterAction.h>

#include <filesystem>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "pose_refiner_graph.h"
#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;
using Client = actionlib::SimpleActionClient<RegisterAction>;

/// A caller of ~register and what it hears.
class Caller {
 public:
  explicit Caller(const std::string& refiner)
      : client_(refiner + "/" + topics::kRegister, /*spin_thread=*/false) {}

  /// Sends a goal and waits until it is under way.
  bool begin(const RegisterGoal& goal) {
    if (!client_.waitForServer(ros::Duration(30))) return false;
    client_.sendGoal(goal, Client::SimpleDoneCallback(), Client::SimpleActiveCallback(),
                     [this](const RegisterFeedbackConstPtr& feedback) {
                       std::lock_guard<std::mutex> lock(mutex_);
                       heard_.push_back(*feedback);
                     });
    return waitUntil([this] { return !heard().empty(); });
  }

  /// Waits for the end of the goal. @return how it ended, and the result.
  std::string end(RegisterResult* result) {
    // Under AddressSanitizer learning takes most of a minute.
    if (!client_.waitForResult(ros::Duration(120))) return "not at all";
    *result = *client_.getResult();
    return client_.getState().toString();
  }

  void cancel() { client_.cancelGoal(); }
  bool running() { return client_.getState() == actionlib::SimpleClientGoalState::ACTIVE; }

  std::vector<RegisterFeedback> heard() {
    std::lock_guard<std::mutex> lock(mutex_);
    return heard_;
  }

 private:
  std::mutex mutex_;  ///< guards heard_
  std::vector<RegisterFeedback> heard_;
  Client client_;  ///< last: it calls back
};

class RegistrationTest : public PoseRefinerTest {
 protected:
  void TearDown() override {
    fs::remove(model());
    EXPECT_TRUE(setObject("toy").success);
  }

  static fs::path model() { return fs::path(world->root) / "models" / "new.safetensors"; }

  static RegisterGoal goal() {
    RegisterGoal goal;
    goal.name = "new";
    goal.dataset = "toy";
    goal.metres_per_unit = kMetresPerUnit;
    return goal;
  }

  RegisterResult result;
};

TEST_F(RegistrationTest, TheActionTellsHowItGoesOnAndTheServiceJoinsIt) {
  Caller caller("pose_refiner");
  ASSERT_TRUE(caller.begin(goal()));
  const RegisterObject joined = learnField("new", "toy", kMetresPerUnit);
  EXPECT_TRUE(joined.response.success) << joined.response.message;
  ASSERT_EQ(caller.end(&result), "SUCCEEDED") << result.message;
  EXPECT_TRUE(result.success);
  EXPECT_FALSE(result.loaded_existing || joined.response.loaded_existing);
  EXPECT_GT(result.psnr_db, 20);
  EXPECT_EQ(joined.response.psnr_db, result.psnr_db);
  EXPECT_TRUE(infoOf("new")->tracked);
  int previews = 0;
  for (const RegisterFeedback& feedback : caller.heard()) {
    EXPECT_EQ(feedback.steps, 300u);
    if (feedback.preview.data.empty()) continue;
    ++previews;
    EXPECT_EQ(feedback.preview.format, "jpeg");
    EXPECT_EQ(feedback.preview.data.at(0), 0xff);
    EXPECT_EQ(feedback.preview.data.at(1), 0xd8);
  }
  EXPECT_EQ(caller.heard().front().stage, "training");
  EXPECT_GE(previews, 1);
}

TEST_F(RegistrationTest, OneThatIsJoinedOutlivesTheCancelOfTheFirst) {
  Caller first("pose_refiner"), second("pose_refiner");
  ASSERT_TRUE(first.begin(goal()));
  ASSERT_TRUE(second.begin(goal()));
  first.cancel();
  EXPECT_EQ(first.end(&result), "PREEMPTED");
  EXPECT_FALSE(result.success);
  EXPECT_EQ(second.end(&result), "SUCCEEDED") << result.message;
  EXPECT_FALSE(result.loaded_existing);
}

/// The refiner whose registrations take longer than any test.
class PatientTest : public RegistrationTest {
 protected:
  PatientTest()
      : patient("patient"),
        poses(patient, "pose"),
        initial_pose(patient.advertise<geometry_msgs::PoseStamped>("initial_pose", 5)) {}

  void SetUp() override {
    RegistrationTest::SetUp();
    ASSERT_TRUE(waitUntil([&] { return initial_pose.getNumSubscribers() > 0; }));
    SetObject::Request request;
    request.name = "toy";
    ASSERT_TRUE(ask<SetObject>("set_object", request).success);
  }

  template <typename Service>
  typename Service::Response ask(const std::string& name, typename Service::Request request = {}) {
    typename Service::Response response;
    EXPECT_TRUE(patient.serviceClient<Service>(name).call(request, response)) << name;
    return response;
  }

  bool tracks() {
    poses.clear();
    initial_pose.publish(roughPose());
    return poses.wait().has_value();
  }

  ros::NodeHandle patient;
  Listener<geometry_msgs::PoseStamped> poses;
  ros::Publisher initial_pose;
};

TEST_F(PatientTest, AllElseAnswersMeanwhileAndACancelLeavesNothing) {
  Caller caller("patient");
  ASSERT_TRUE(caller.begin(goal()));
  RegisterObject::Request other;
  other.name = "other";
  other.dataset = "toy";
  const RegisterObject::Response busy = ask<RegisterObject>("register_object", other);
  EXPECT_FALSE(busy.success);
  EXPECT_NE(busy.message.find("'new' is being registered (training, step"), std::string::npos)
      << busy.message;
  EXPECT_TRUE(tracks());
  LoadObject::Request load;
  load.name = "toy";
  EXPECT_TRUE(ask<LoadObject>("load_object", load).success);
  EXPECT_TRUE(listObjects().success);
  EXPECT_TRUE(caller.running());

  caller.cancel();
  EXPECT_EQ(caller.end(&result), "PREEMPTED");
  EXPECT_FALSE(result.success);
  for (const auto& file : fs::directory_iterator(model().parent_path())) {
    EXPECT_EQ(file.path().filename(), "toy.safetensors") << "nothing else, whole or half";
  }
  EXPECT_TRUE(tracks()) << "the old model serves";
}

}  // namespace
}  // namespace nerf_pose_refiner
