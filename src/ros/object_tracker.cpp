// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/ros/object_tracker.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "nerf_pose_refiner/ros/input_error.h"
#include "nerf_pose_refiner/ros/pose_conversions.h"

namespace nerf_pose_refiner {
namespace {

using Status = RefinementStatus;

/// Why a refinement is not trusted; REASON_NONE: it is.
std::pair<std::uint8_t, std::string> verdict(const Refinement& refinement, double min_score) {
  switch (refinement.outcome) {
    case Outcome::kNoOverlap:
      return {Status::REASON_NO_OVERLAP, "the start pose lies outside of the image"};
    case Outcome::kDiverged:
      return {Status::REASON_DIVERGED, "no hypothesis survived"};
    case Outcome::kStopped:
      return {Status::REASON_STOPPED, "the refinement was interrupted"};
    case Outcome::kRefined:
      break;
  }
  if (refinement.score >= min_score) return {Status::REASON_NONE, ""};
  return {Status::REASON_LOW_SCORE, "the pose explains the image badly (~tracker/min_score)"};
}

}  // namespace

ObjectTracker::ObjectTracker(const PoseRefinerParameters& parameters,
                             std::unique_ptr<ObjectSearch> search, tf2::BufferCore* transforms,
                             Report report)
    : parameters_(parameters),
      transforms_(transforms),
      report_(std::move(report)),
      search_(std::move(search)),
      input_(parameters.image_is_rectified),
      tf_(*transforms, parameters.frames),
      state_(parameters.rules) {}

bool ObjectTracker::clockIs(const ros::Time& now) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (!state_.clockIs(now)) return false;
  running_.requestStop();
  transforms_->clear();
  return true;
}

std::optional<std::string> ObjectTracker::refusal(const sensor_msgs::Image& image,
                                                  const sensor_msgs::CameraInfo& info) {
  try {
    checkImage(image, cameraFromMessage(info, parameters_.image_is_rectified).camera);
    std::lock_guard<std::mutex> lock(mutex_);
    state_.imageArrived();
    return std::nullopt;
  } catch (const InputError& e) {
    std::lock_guard<std::mutex> lock(mutex_);
    state_.imageRefused(e.reason(), e.what());
    return e.what();
  }
}

void ObjectTracker::offer(const StartPose& initial_pose) {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.offer(initial_pose);
}

void ObjectTracker::refuseInitialPose(std::uint8_t reason, const std::string& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.refuseInitialPose(reason, message);
}

void ObjectTracker::modelIsLoading() {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.modelIsLoading();
}

void ObjectTracker::modelFailed(std::uint8_t reason, const std::string& message) {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.modelFailed(reason, message);
}

std::future<void> ObjectTracker::offerModel(std::shared_ptr<const Field> field) {
  std::lock_guard<std::mutex> lock(mutex_);
  pending_models_.push_back({std::move(field), {}});
  running_.requestStop();
  return pending_models_.back().done.get_future();
}

void ObjectTracker::applyModels() {
  while (true) {
    PendingModel model;
    {
      std::lock_guard<std::mutex> lock(mutex_);
      if (pending_models_.empty()) return;
      model = std::move(pending_models_.front());
      pending_models_.pop_front();
    }
    try {
      search_->use(model.field);
      std::lock_guard<std::mutex> lock(mutex_);
      field_ = model.field;
      state_.modelIsReady();
      model.done.set_value();
    } catch (const std::exception& e) {
      modelFailed(Status::REASON_INTERNAL, e.what());
      model.done.set_exception(std::current_exception());
    }
  }
}

void ObjectTracker::reset() {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.reset();
  running_.requestStop();
}

void ObjectTracker::setEnabled(bool enabled) {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.setEnabled(enabled);
  if (!enabled) running_.requestStop();
}

void ObjectTracker::stop() {
  std::lock_guard<std::mutex> lock(mutex_);
  stopping_ = true;
  running_.requestStop();
}

std::string ObjectTracker::objectName() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return field_ ? field_->metadata.name : std::string();
}

RefinementStatus ObjectTracker::statusNow(const std_msgs::Header& header) const {
  std::lock_guard<std::mutex> lock(mutex_);
  RefinementStatus status;
  status.header = header;
  status.object = field_ ? field_->metadata.name : std::string();
  status.state = state_.condition().state;
  status.reason = state_.condition().reason;
  status.message = state_.condition().message;
  status.processed = processed_;
  return status;
}

void ObjectTracker::reportChange(const std_msgs::Header& header) {
  const RefinementStatus status = statusNow(header);
  const Condition condition{status.state, status.reason, status.message};
  if (reported_ && *reported_ == condition) return;
  reported_ = condition;
  report_(status);
}

std::optional<FrameResult> ObjectTracker::process(const CameraFrame& frame) {
  const std_msgs::Header& header = frame.image->header;
  FrameDecision decision;
  StopToken stop;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    decision = state_.decide(header.stamp, header.frame_id);
    running_ = stop;
    if (stopping_) stop.requestStop();
    if (decision.clock_jumped) transforms_->clear();
  }
  reportChange(header);
  if (!decision.start) return std::nullopt;

  FrameResult result;
  try {
    refine(frame, decision, stop, &result);
  } catch (const std::exception& e) {
    std::lock_guard<std::mutex> lock(mutex_);
    state_.failed(decision.ticket, e.what());
  }
  ++processed_;
  RefinementStatus& status = result.status;
  status = statusNow(header);
  reported_ = Condition{status.state, status.reason, status.message};
  if (status.reason == Status::REASON_NONE && !result.no_transform.empty()) {
    status.reason = Status::REASON_NO_TRANSFORM;
    status.message = result.no_transform;
  }
  status.score = static_cast<float>(result.refinement.score);
  status.visible_fraction = static_cast<float>(result.refinement.visible_fraction);
  status.latency_s = static_cast<float>((ros::WallTime::now() - frame.arrival).toSec());
  status.image_age_s = static_cast<float>(ros::Time::now().toSec() - header.stamp.toSec());
  return result;
}

Prior ObjectTracker::priorFrom(const StartPose& start, const Pose& T_C_O) const {
  const FieldMetadata& object = field_->metadata;
  const SearchSettings& settings = start.tracked ? parameters_.tracking : parameters_.initial;
  Prior prior;
  prior.T_O_C = cameraInObject(T_C_O, object.metres_per_unit);
  prior.rotation_rad = settings.rotation_deg * M_PI / 180;
  prior.translation = settings.translation;
  if (start.rotation_rad > 0) prior.rotation_rad = std::min(start.rotation_rad, M_PI);
  if (start.translation_m > 0) {
    prior.translation = start.translation_m / (object.metres_per_unit * object.diameter);
  }
  return prior;
}

void ObjectTracker::refine(const CameraFrame& frame, const FrameDecision& decision,
                           const StopToken& stop, FrameResult* result) {
  const std_msgs::Header& header = frame.image->header;
  const StartPose& start = *decision.start;
  // Looked up now: when the refinement is done, the buffer may have forgotten.
  std::optional<Pose> T_W_C;
  try {
    T_W_C = tf_.cameraInOutput(header.frame_id, header.stamp, stop);
  } catch (const InputError& e) {
    result->no_transform = e.what();
  }
  Pose T_C_O;
  try {
    T_C_O = tf_.startInCamera(start, header.frame_id, header.stamp, stop);
  } catch (const InputError& e) {
    std::lock_guard<std::mutex> lock(mutex_);
    state_.startRefused(decision.ticket, e.what());
    return;
  }
  result->field = field_;
  result->observation =
      std::make_shared<const Observation>(input_.observe(*frame.image, *frame.info));
  result->refinement =
      search_->search(*result->observation, priorFrom(start, T_C_O), start.tracked, stop);
  const bool trusted = conclude(header, decision.ticket, result->refinement);
  if (T_W_C) place(header, *T_W_C, trusted, result);
}

bool ObjectTracker::conclude(const std_msgs::Header& header, std::uint64_t ticket,
                             const Refinement& refinement) {
  const auto [reason, message] = verdict(refinement, parameters_.rules.min_score);
  const Pose T_C_O = objectInCamera(refinement.T_O_C, field_->metadata.metres_per_unit);
  std::lock_guard<std::mutex> lock(mutex_);
  if (reason == Status::REASON_NONE) {
    return state_.trusted(ticket, T_C_O, header.frame_id, header.stamp);
  }
  state_.notTrusted(ticket, reason, message);
  return false;
}

void ObjectTracker::place(const std_msgs::Header& header, const Pose& T_W_C, bool trusted,
                          FrameResult* result) const {
  const FieldMetadata& object = field_->metadata;
  std_msgs::Header placed = header;
  placed.frame_id = tf_.outputFrame(header.frame_id);
  result->hypotheses = toMessage(result->refinement.hypotheses, T_W_C, object.metres_per_unit);
  result->hypotheses.object = object.name;
  result->hypotheses.header = placed;
  if (!trusted) return;
  result->pose.emplace();
  result->pose->header = placed;
  result->pose->pose =
      toMessage(T_W_C * objectInCamera(result->refinement.T_O_C, object.metres_per_unit));
}

}  // namespace nerf_pose_refiner
