// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/diagnostics.h"

#include <ros/console.h>

#include <algorithm>
#include <cstdio>
#include <limits>
#include <optional>

#include "concurrency/error_of.h"

namespace nerf_pose_refiner {
namespace {

using Status = RefinementStatus;
using Level = diagnostic_msgs::DiagnosticStatus;

struct StateText {
  std::uint8_t level;
  const char* name;
};

StateText describe(std::uint8_t state) {
  switch (state) {
    case Status::STATE_NO_MODEL:
      return {Level::WARN, "no model"};
    case Status::STATE_LOADING:
      return {Level::OK, "loading"};
    case Status::STATE_WAITING:
      return {Level::OK, "waiting"};
    case Status::STATE_REFINING:
      return {Level::OK, "refining"};
    case Status::STATE_TRACKING:
      return {Level::OK, "tracking"};
    case Status::STATE_LOST:
      return {Level::WARN, "lost"};
    default:
      return {Level::ERROR, "error"};
  }
}

std::string describeDepth(const Status& status) {
  switch (status.depth) {
    case Status::DEPTH_USED: {
      char text[100];
      std::snprintf(text, sizeof text, "used: %.0f %% agrees, bias of the sensor %.1f mm",
                    100 * status.depth_agreement, 1e3 * status.depth_bias_m);
      return text;
    }
    case Status::DEPTH_REFUSED:
      return "refused: " + status.depth_message;
    default:
      return status.depth_message.empty() ? "none" : "none: " + status.depth_message;
  }
}

}  // namespace

TopicHealth::TopicHealth(const std::string& name, const std::string& why_quiet, double min_rate_hz,
                         double max_age_s)
    : diagnostic_updater::DiagnosticTask(name),
      min_rate_hz_(min_rate_hz),
      max_rate_hz_(std::numeric_limits<double>::infinity()),
      why_quiet_(why_quiet),
      rate_(diagnostic_updater::FrequencyStatusParam(&min_rate_hz_, &max_rate_hz_)),
      stamps_(diagnostic_updater::TimeStampStatusParam(-1, max_age_s)) {}

void TopicHealth::tick(const ros::Time& stamp) {
  std::lock_guard<std::mutex> lock(mutex_);
  rate_.tick();
  stamps_.tick(stamp);
}

void TopicHealth::expect(bool expected) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (expected && !expected_) rate_.clear();  // the rate of the time before is no fault
  expected_ = expected;
}

void TopicHealth::run(diagnostic_updater::DiagnosticStatusWrapper& report) {
  std::lock_guard<std::mutex> lock(mutex_);
  diagnostic_updater::DiagnosticStatusWrapper of_stamps;
  stamps_.run(of_stamps);
  rate_.run(report);
  report.values.insert(report.values.end(), of_stamps.values.begin(), of_stamps.values.end());
  if (!expected_) {
    report.summary(Level::OK, why_quiet_);
  } else if (of_stamps.level != Level::OK && report.level != Level::ERROR) {
    report.mergeSummary(of_stamps);
  }
}

Diagnostics::Diagnostics(const NodeHandles& nodes, const std::string& name,
                         const DiagnosticSettings& settings)
    : images_("images", "nobody makes use of them", settings.min_image_rate_hz,
              settings.max_image_age_s),
      poses_("poses", "nothing is tracked", 0, std::numeric_limits<double>::infinity()),
      since_(ros::WallTime::now()),
      updater_(nodes.nh, nodes.pnh, name),
      spinner_(1, &queue_) {
  updater_.setHardwareID("none");
  updater_.add("tracking", this, &Diagnostics::fillTracking);
  updater_.add(images_);
  updater_.add(poses_);
  updater_.add("engine", this, &Diagnostics::fillBackend);
  ros::NodeHandle timer_nh(nodes.pnh);
  timer_nh.setCallbackQueue(&queue_);
  timer_ = timer_nh.createWallTimer(
      ros::WallDuration(1.0), [this](const ros::WallTimerEvent&) { updater_.force_update(); });
  spinner_.start();
}

void Diagnostics::imageIsThere(std::uint32_t sequence) {
  constexpr std::uint32_t kAnotherSender = 10000;  // began elsewhere: no gap
  std::lock_guard<std::mutex> lock(mutex_);
  const std::uint32_t gap = sequence - sequence_ - 1;
  if (counts_.arrived > 0 && gap < kAnotherSender) counts_.lost += gap;
  ++counts_.arrived;
  sequence_ = sequence;
}

void Diagnostics::count(std::uint64_t ImageCounts::*what) {
  std::lock_guard<std::mutex> lock(mutex_);
  ++(counts_.*what);
}

void Diagnostics::statusIs(const RefinementStatus& status) {
  poses_.expect(status.state == Status::STATE_TRACKING);
  std::lock_guard<std::mutex> lock(mutex_);
  if (status.latency_s > 0) refined_ = status;
  status_ = status;
}

void Diagnostics::backendIs(const std::string& description) {
  std::lock_guard<std::mutex> lock(mutex_);
  backend_ = description;
}

void Diagnostics::showMemory(std::function<Facts()> memory) {
  std::lock_guard<std::mutex> lock(mutex_);
  memory_ = std::move(memory);
}

void Diagnostics::guard(const char* name, const std::function<void()>& callback) {
  const std::optional<std::string> error = errorOf(callback);
  if (!error) return;
  if (errors_.passes()) ROS_ERROR("%s: %s", name, error->c_str());
  std::lock_guard<std::mutex> lock(mutex_);
  ++failures_;
  failure_ = *error;
}

void Diagnostics::fillTracking(diagnostic_updater::DiagnosticStatusWrapper& report) {
  std::lock_guard<std::mutex> lock(mutex_);
  const StateText state = describe(status_.state);
  report.summary(state.level,
                 std::string(state.name) + (status_.message.empty() ? "" : ": " + status_.message));
  if (refined_.depth == Status::DEPTH_REFUSED) {
    report.mergeSummary(Level::WARN, "depth is not used: " + refined_.depth_message);
  }
  if (!failure_.empty()) report.mergeSummary(Level::ERROR, failure_);
  failure_.clear();
  const ros::WallTime now = ros::WallTime::now();
  const double seconds = std::max(1e-3, (now - since_).toSec());
  report.add("object", status_.object.empty() ? std::string("none") : status_.object);
  report.addf("refined [Hz]", "%.2f", (status_.processed - processed_before_) / seconds);
  report.addf("latency [s]", "%.3f", refined_.latency_s);
  report.addf("age of the image [s]", "%.3f", refined_.image_age_s);
  report.addf("score", "%.3f", refined_.score);
  report.addf("visible fraction", "%.3f", refined_.visible_fraction);
  report.add("depth", describeDepth(refined_));
  report.add("cameras in the last pose", std::to_string(refined_.cameras) +
                                             (refined_.cameras_message.empty() ? "" : ": ") +
                                             refined_.cameras_message);
  report.add("refined images", status_.processed);
  report.add("dropped images", status_.dropped);
  report.add("arrived images", counts_.arrived);
  report.add("images lost before", counts_.lost);
  report.add("images with camera_info", counts_.with_camera_info);
  report.add("refused images", counts_.refused);
  report.add("skipped images", counts_.skipped);
  report.add("exceptions", failures_);
  processed_before_ = status_.processed;
  since_ = now;
}

void Diagnostics::fillBackend(diagnostic_updater::DiagnosticStatusWrapper& report) {
  std::function<Facts()> memory;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    report.summary(Level::OK, backend_.empty() ? "none yet: made with the first model" : backend_);
    report.add("engine", backend_.empty() ? std::string("none") : backend_);
    memory = memory_;
  }
  if (!memory) return;
  for (const auto& fact : memory()) report.add(fact.first, fact.second);
}

}  // namespace nerf_pose_refiner
