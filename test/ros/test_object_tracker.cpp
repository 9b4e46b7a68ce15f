// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/ros/object_tracker.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <memory>
#include <stdexcept>
#include <thread>
#include <vector>

namespace nerf_pose_refiner {
namespace {

using Status = RefinementStatus;

/// Finds the object one unit in front of the camera, and remembers what it was asked.
class FakeSearch : public ObjectSearch {
 public:
  void use(std::shared_ptr<const Field> field) override {
    if (field->metadata.name == "cursed") throw std::runtime_error("does not fit the memory");
    object = field->metadata.name;
  }

  Refinement search(const Observation& observation, const Prior& prior, bool tracked,
                    const StopToken& stop) override {
    priors.push_back(prior);
    was_tracked.push_back(tracked);
    width = observation.image.width;
    if (throws) throw std::runtime_error("the engine broke");
    while (waits_to_be_stopped && !stop.stopRequested()) {
      searching = true;
      std::this_thread::yield();
    }
    Refinement refinement;
    refinement.outcome = stop.stopRequested() ? Outcome::kStopped : outcome;
    refinement.score = score;
    refinement.visible_fraction = 0.75;
    refinement.T_O_C.t.z() = -1;
    refinement.hypotheses.resize(2);
    for (Hypothesis& hypothesis : refinement.hypotheses) hypothesis.T_O_C.t.z() = -1;
    return refinement;
  }

  std::string object;
  std::vector<Prior> priors;
  std::vector<bool> was_tracked;
  int width = 0;
  Outcome outcome = Outcome::kRefined;
  double score = 0.9;
  bool throws = false;
  bool waits_to_be_stopped = false;
  std::atomic<bool> searching{false};
};

std::shared_ptr<const Field> fieldCalled(const std::string& name) {
  auto field = std::make_shared<Field>();
  field->metadata.name = name;
  field->metadata.metres_per_unit = 0.1;
  field->metadata.diameter = 2;  // 0.2 m
  return field;
}

class ObjectTrackerTest : public testing::Test {
 protected:
  ObjectTrackerTest() {
    parameters_.frames.tf_timeout_s = 0;
    parameters_.rules.min_score = 0.5;
    parameters_.rules.max_failures = 1;
    restart();
  }

  void restart() {
    auto search = std::make_unique<FakeSearch>();
    search_ = search.get();
    reports_.clear();
    tracker_ = std::make_unique<ObjectTracker>(
        parameters_, std::move(search), &transforms_,
        [this](const RefinementStatus& status) { reports_.push_back(status); });
  }

  void useModel(const std::string& name = "mug") {
    std::future<void> done = tracker_->offerModel(fieldCalled(name));
    tracker_->applyModels();
    done.get();
  }

  static CameraFrame frameAt(double seconds, const std::string& frame_id = "camera") {
    auto image = boost::make_shared<sensor_msgs::Image>();
    image->header.frame_id = frame_id;
    image->header.stamp = ros::Time(1000 + seconds);
    image->width = 4;
    image->height = 2;
    image->encoding = "mono8";
    image->step = 4;
    image->data.resize(8, 100);
    auto info = boost::make_shared<sensor_msgs::CameraInfo>();
    info->width = 4;
    info->height = 2;
    info->K = {5, 0, 1.5, 0, 5, 0.5, 0, 0, 1};
    return {image, info, ros::WallTime::now()};
  }

  void offer(const std::string& frame_id = "camera") {
    StartPose start;
    start.frame_id = frame_id;
    start.T_P_O.t.z() = 0.4;
    tracker_->offer(start);
  }

  void addTransform(const std::string& parent, const std::string& child, double seconds, double x) {
    geometry_msgs::TransformStamped transform;
    transform.header.frame_id = parent;
    transform.header.stamp = ros::Time(1000 + seconds);
    transform.child_frame_id = child;
    transform.transform.translation.x = x;
    transform.transform.rotation.w = 1;
    transforms_.setTransform(transform, "test");
  }

  PoseRefinerParameters parameters_;
  tf2::BufferCore transforms_;
  std::vector<RefinementStatus> reports_;
  std::unique_ptr<ObjectTracker> tracker_;
  FakeSearch* search_ = nullptr;
};

TEST_F(ObjectTrackerTest, LeavesImagesAloneUntilThereIsAPose) {
  EXPECT_FALSE(tracker_->process(frameAt(0)));
  useModel();
  EXPECT_FALSE(tracker_->process(frameAt(0.1)));
  EXPECT_TRUE(search_->priors.empty());
  ASSERT_EQ(reports_.size(), 2u);
  EXPECT_EQ(int{reports_[0].state}, int{Status::STATE_NO_MODEL});
  EXPECT_EQ(int{reports_[1].state}, int{Status::STATE_WAITING});
  EXPECT_EQ(reports_[1].object, "mug");
}

TEST_F(ObjectTrackerTest, RefinesInModelUnitsAndAnswersInMetres) {
  useModel();
  offer();
  const auto result = tracker_->process(frameAt(0));
  ASSERT_TRUE(result);
  ASSERT_EQ(search_->priors.size(), 1u);
  EXPECT_NEAR(search_->priors[0].T_O_C.t.z(), -4, 1e-12);  // 0.4 m
  EXPECT_EQ(search_->width, 4);
  ASSERT_TRUE(result->pose);
  EXPECT_NEAR(result->pose->pose.position.z, 0.1, 1e-12);  // 1 unit
  EXPECT_EQ(result->pose->header.stamp, ros::Time(1000));
  EXPECT_EQ(result->pose->header.frame_id, "camera");
  EXPECT_EQ(result->hypotheses.hypotheses.size(), 2u);
  EXPECT_EQ(result->hypotheses.object, "mug");
  EXPECT_EQ(result->hypotheses.header.stamp, ros::Time(1000));
  EXPECT_NEAR(result->hypotheses.hypotheses[1].pose.position.z, 0.1, 1e-12);
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_TRACKING});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_NONE});
  EXPECT_FLOAT_EQ(result->status.score, 0.9f);
  EXPECT_FLOAT_EQ(result->status.visible_fraction, 0.75f);
  EXPECT_GT(result->status.latency_s, 0);
  EXPECT_EQ(result->status.processed, 1u);
  EXPECT_EQ(result->status.header.stamp, ros::Time(1000));
  EXPECT_EQ(int{reports_.back().state}, int{Status::STATE_REFINING}) << "said before it began";
}

TEST_F(ObjectTrackerTest, FollowsFromTheLastPoseInANarrowSearch) {
  useModel();
  offer();
  tracker_->process(frameAt(0));
  tracker_->process(frameAt(0.1));
  ASSERT_EQ(search_->priors.size(), 2u);
  EXPECT_EQ(search_->was_tracked, (std::vector<bool>{false, true}));
  EXPECT_NEAR(search_->priors[1].T_O_C.t.z(), -1, 1e-12);
  EXPECT_NEAR(search_->priors[0].rotation_rad, 15 * M_PI / 180, 1e-12);
  EXPECT_NEAR(search_->priors[0].translation, 0.15, 1e-12);
  EXPECT_NEAR(search_->priors[1].rotation_rad, 5 * M_PI / 180, 1e-12);
  EXPECT_NEAR(search_->priors[1].translation, 0.05, 1e-12);
}

TEST_F(ObjectTrackerTest, SearchesAsWideAsTheInitialPoseSays) {
  useModel();
  StartPose start;
  start.frame_id = "camera";
  start.rotation_rad = 0.5;
  start.translation_m = 0.05;
  tracker_->offer(start);
  tracker_->process(frameAt(0));
  EXPECT_NEAR(search_->priors.at(0).rotation_rad, 0.5, 1e-12);
  EXPECT_NEAR(search_->priors.at(0).translation, 0.25, 1e-12);  // of a diameter of 0.2 m
}

TEST_F(ObjectTrackerTest, KeepsPosesToItselfThatItDoesNotTrust) {
  useModel();
  offer();
  tracker_->process(frameAt(0));
  search_->score = 0.4;
  auto result = tracker_->process(frameAt(0.1));
  ASSERT_TRUE(result);
  EXPECT_FALSE(result->pose);
  EXPECT_EQ(result->hypotheses.hypotheses.size(), 2u);
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_TRACKING});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_LOW_SCORE});
  search_->outcome = Outcome::kNoOverlap;
  result = tracker_->process(frameAt(0.2));
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_LOST});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_NO_OVERLAP});
}

TEST_F(ObjectTrackerTest, OutlivesAnEngineThatThrows) {
  useModel();
  offer();
  search_->throws = true;
  const auto result = tracker_->process(frameAt(0));
  ASSERT_TRUE(result);
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_ERROR});
  EXPECT_EQ(result->status.message, "the engine broke");
  EXPECT_EQ(result->observation->image.width, 4);
  search_->throws = false;
  offer();
  EXPECT_TRUE(tracker_->process(frameAt(0.1))->pose);
}

TEST_F(ObjectTrackerTest, RefusesAnInitialPoseInAnUnknownFrame) {
  useModel();
  offer("nowhere");
  const auto result = tracker_->process(frameAt(0));
  ASSERT_TRUE(result);
  EXPECT_FALSE(result->observation);
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_WAITING});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_PRIOR_NO_FRAME});
  EXPECT_NE(result->status.message.find("nowhere"), std::string::npos) << result->status.message;
  EXPECT_TRUE(search_->priors.empty());
}

TEST_F(ObjectTrackerTest, PublishesInTheOutputFrame) {
  parameters_.frames.output_frame = "base";
  restart();
  useModel();
  addTransform("base", "camera", 0, 7);
  offer();
  auto result = tracker_->process(frameAt(0));
  ASSERT_TRUE(result->pose);
  EXPECT_EQ(result->pose->header.frame_id, "base");
  EXPECT_NEAR(result->pose->pose.position.x, 7, 1e-12);
  EXPECT_NEAR(result->hypotheses.hypotheses[0].pose.position.x, 7, 1e-12);
  // Where the camera is now TF does not say: the object is tracked, but cannot be placed.
  result = tracker_->process(frameAt(0.1));
  EXPECT_FALSE(result->pose);
  EXPECT_TRUE(result->hypotheses.hypotheses.empty());
  EXPECT_EQ(int{result->status.state}, int{Status::STATE_TRACKING});
  EXPECT_EQ(int{result->status.reason}, int{Status::REASON_NO_TRANSFORM});
  addTransform("base", "camera", 0.2, 8);
  EXPECT_NEAR(tracker_->process(frameAt(0.2))->pose->pose.position.x, 8, 1e-12);
}

TEST_F(ObjectTrackerTest, FollowsThroughTheFixedFrame) {
  parameters_.frames.fixed_frame = "base";
  restart();
  useModel();
  addTransform("base", "camera", 0, 0);
  addTransform("base", "camera", 0.1, 0.3);
  offer();
  tracker_->process(frameAt(0));
  tracker_->process(frameAt(0.1));
  // The camera moved by 0.3 m to +x, so the object is 0.3 m farther to -x for it: 3 units.
  EXPECT_NEAR(search_->priors.at(1).T_O_C.t.x(), 3, 1e-9);
}

TEST_F(ObjectTrackerTest, ChangesTheModelWhileItRefines) {
  useModel();
  offer();
  search_->waits_to_be_stopped = true;
  std::optional<FrameResult> result;
  std::thread worker([&] { result = tracker_->process(frameAt(0)); });
  while (!search_->searching) std::this_thread::yield();
  std::future<void> done = tracker_->offerModel(fieldCalled("cup"));
  worker.join();
  EXPECT_FALSE(result->pose);
  EXPECT_EQ(result->field->metadata.name, "mug");
  EXPECT_EQ(tracker_->objectName(), "mug");
  tracker_->applyModels();
  done.get();
  EXPECT_EQ(tracker_->objectName(), "cup");
  EXPECT_EQ(search_->object, "cup");
}

TEST_F(ObjectTrackerTest, KeepsItsModelWhenAnotherCannotBeUsed) {
  useModel();
  std::future<void> done = tracker_->offerModel(fieldCalled("cursed"));
  tracker_->applyModels();
  EXPECT_THROW(done.get(), std::runtime_error);
  EXPECT_EQ(tracker_->objectName(), "mug");
  offer();
  EXPECT_TRUE(tracker_->process(frameAt(0))->pose);
}

TEST_F(ObjectTrackerTest, StopsARefinementOnRequest) {
  for (int request = 0; request < 4; ++request) {
    restart();
    useModel();
    tracker_->clockIs(ros::Time(1000));
    offer();
    search_->waits_to_be_stopped = true;
    std::optional<FrameResult> result;
    std::thread worker([&] { result = tracker_->process(frameAt(0)); });
    while (!search_->searching) std::this_thread::yield();
    if (request == 0) tracker_->reset();
    if (request == 1) tracker_->setEnabled(false);
    if (request == 2) tracker_->stop();
    if (request == 3) tracker_->clockIs(ros::Time(900));
    worker.join();
    EXPECT_FALSE(result->pose) << request;
  }
}

TEST_F(ObjectTrackerTest, DropsTransformsWhenTimeGoesBack) {
  useModel();
  addTransform("base", "camera", 0, 1);
  tracker_->clockIs(ros::Time(1000));
  EXPECT_TRUE(transforms_.canTransform("base", "camera", ros::Time(1000)));
  tracker_->clockIs(ros::Time(900));
  EXPECT_FALSE(transforms_.canTransform("base", "camera", ros::Time(1000)));

  addTransform("base", "camera", 0, 1);
  tracker_->process(frameAt(0));
  tracker_->process(frameAt(-10));
  EXPECT_FALSE(transforms_.canTransform("base", "camera", ros::Time(1000)));
}

TEST_F(ObjectTrackerTest, SaysWhyAnImageIsRefused) {
  CameraFrame frame = frameAt(0);
  EXPECT_FALSE(tracker_->refusal(*frame.image, *frame.info));
  sensor_msgs::CameraInfo uncalibrated = *frame.info;
  uncalibrated.K[0] = 0;
  EXPECT_TRUE(tracker_->refusal(*frame.image, uncalibrated));
  tracker_->reportChange(frame.image->header);
  EXPECT_EQ(int{reports_.back().reason}, int{Status::REASON_UNCALIBRATED});
  tracker_->reportChange(frame.image->header);
  EXPECT_EQ(reports_.size(), 1u) << "once";
}

TEST_F(ObjectTrackerTest, OutlivesImagesThatChangeTheirSize) {
  useModel();
  offer();
  EXPECT_TRUE(tracker_->process(frameAt(0))->pose);
  CameraFrame frame = frameAt(0.1);
  auto image = boost::make_shared<sensor_msgs::Image>(*frame.image);
  auto info = boost::make_shared<sensor_msgs::CameraInfo>(*frame.info);
  image->width = image->step = info->width = 3;
  image->data.resize(6);
  EXPECT_TRUE(tracker_->process({image, info, frame.arrival})->pose);
  EXPECT_EQ(search_->width, 3);
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  testing::InitGoogleTest(&argc, argv);
  ros::Time::init();
  return RUN_ALL_TESTS();
}
