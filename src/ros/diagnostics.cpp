// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/ros/diagnostics.h"

#include <algorithm>

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

}  // namespace

Diagnostics::Diagnostics(const ros::NodeHandle& nh, const ros::NodeHandle& pnh,
                         const std::string& name)
    : since_(ros::WallTime::now()), updater_(nh, pnh, name) {
  updater_.setHardwareID("none");
  updater_.add("tracking", this, &Diagnostics::fill);
  timer_ = pnh.createWallTimer(ros::WallDuration(1.0),
                               [this](const ros::WallTimerEvent&) { updater_.force_update(); });
}

void Diagnostics::statusIs(const RefinementStatus& status) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (status.latency_s > 0) latency_s_ = status.latency_s;
  status_ = status;
}

void Diagnostics::imageArrived() {
  std::lock_guard<std::mutex> lock(mutex_);
  ++images_;
}

void Diagnostics::callbackFailed(const std::string& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  ++failures_;
  failure_ = message;
}

void Diagnostics::fill(diagnostic_updater::DiagnosticStatusWrapper& report) {
  std::lock_guard<std::mutex> lock(mutex_);
  const StateText state = describe(status_.state);
  report.summary(state.level,
                 std::string(state.name) + (status_.message.empty() ? "" : ": " + status_.message));
  if (!failure_.empty()) report.mergeSummary(Level::ERROR, failure_);
  failure_.clear();
  const ros::WallTime now = ros::WallTime::now();
  const double seconds = std::max(1e-3, (now - since_).toSec());
  report.add("object", status_.object.empty() ? std::string("none") : status_.object);
  report.addf("images [Hz]", "%.2f", images_ / seconds);
  report.addf("refined [Hz]", "%.2f", (status_.processed - processed_before_) / seconds);
  report.addf("latency [s]", "%.3f", latency_s_);
  report.addf("score", "%.3f", status_.score);
  report.add("refined images", status_.processed);
  report.add("dropped images", status_.dropped);
  report.add("exceptions", failures_);
  images_ = 0;
  processed_before_ = status_.processed;
  since_ = now;
}

}  // namespace nerf_pose_refiner
