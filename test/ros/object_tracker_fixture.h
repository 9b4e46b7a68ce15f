// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <future>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "ros/nodelet/object_tracker.h"

namespace nerf_pose_refiner {

/// Finds the object one unit in front of the camera, say, and remembers what it was asked.
class FakeSearch : public ObjectSearch {
 public:
  void use(std::shared_ptr<const Field> field) override {
    if (field->metadata.name == "cursed") throw std::runtime_error("does not fit the memory");
    object = field->metadata.name;
  }

  void configure(const RefinerSettings& initial, const RefinerSettings& tracking) override {
    seeds = {initial.seed, tracking.seed};
  }

  Refinement search(const Observation& observation, const Prior& prior, bool tracked,
                    const CancellationToken& stop) override {
    priors.push_back(prior);
    was_tracked.push_back(tracked);
    width = observation.image.width;
    if (throws) throw std::runtime_error("the engine broke");
    while (waits_to_be_stopped && !stop.cancelRequested()) {
      searching = true;
      std::this_thread::yield();
    }
    Refinement refinement;
    refinement.outcome = stop.cancelRequested() ? Outcome::kCancelled : outcome;
    refinement.score = score;
    refinement.visible_fraction = 0.75;
    refinement.T_O_C = T_O_C;
    refinement.hypotheses.resize(2);
    for (Hypothesis& hypothesis : refinement.hypotheses) hypothesis.T_O_C = T_O_C;
    return refinement;
  }

  std::string object;
  std::vector<Prior> priors;
  std::vector<bool> was_tracked;
  std::vector<std::uint64_t> seeds;  ///< of the settings, once they were changed
  int width = 0;
  Pose T_O_C = {Eigen::Matrix3d::Identity(), {0, 0, -1}};  ///< what is found
  Outcome outcome = Outcome::kRefined;
  double score = 0.9;
  bool throws = false;
  bool waits_to_be_stopped = false;
  std::atomic<bool> searching{false};
};

inline std::shared_ptr<const Field> fieldCalled(const std::string& name) {
  auto field = std::make_shared<Field>();
  field->metadata.name = name;
  field->metadata.metres_per_unit = 0.1;
  field->metadata.diameter = 2;  // 0.2 m
  return field;
}

/// The same object, whose frame is some units further along the model's z axis.
inline std::shared_ptr<Field> fieldWithFrameAt(double z) {
  auto field = std::make_shared<Field>(*fieldCalled("mug"));
  field->metadata.T_O_U.t.z() = z;
  return field;
}

/// The same standard deviations in all directions.
inline Matrix6 covarianceOf(double rotation_rad, double translation_m) {
  Vector6 variances;
  variances << Eigen::Vector3d::Constant(translation_m * translation_m),
      Eigen::Vector3d::Constant(rotation_rad * rotation_rad);
  return variances.asDiagonal();
}

class ObjectTrackerTest : public testing::Test {
 protected:
  ObjectTrackerTest() {
    parameters_.frames.tf_timeout_s = 0;
    parameters_.rules.trust_score = 0.7;
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
        [this](const RefinementStatus& status) { reports_.push_back(status); },
        [this] { return clock_(); });
  }

  void useModel(const std::string& name = "mug") { useModel(fieldCalled(name)); }

  void useModel(std::shared_ptr<const Field> field, bool same_looks = false) {
    std::future<void> done = tracker_->offerModel(std::move(field), same_looks);
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
    return {image, info, ros::WallTime::now(), 0};
  }

  void offer(const std::string& frame_id = "camera") {
    InitialPose start;
    start.frame_id = frame_id;
    start.T_P_U.t.z() = 0.4;
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

  /// Seconds after the first image.
  void setClock(double seconds) {
    clock_ = [seconds] { return ros::Time(1000 + seconds); };
  }

  std::function<ros::Time()> clock_ = [] { return ros::Time(1000); };
  PoseRefinerParameters parameters_;
  tf2::BufferCore transforms_;
  std::vector<RefinementStatus> reports_;
  std::unique_ptr<ObjectTracker> tracker_;
  FakeSearch* search_ = nullptr;
};

}  // namespace nerf_pose_refiner
