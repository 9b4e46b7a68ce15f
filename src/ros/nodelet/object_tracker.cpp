// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/object_tracker.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "field/object_frame.h"
#include "ros/conversions/input_error.h"
#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/prior.h"
#include "tracking/prediction.h"

namespace nerf_pose_refiner {
namespace {

using Status = RefinementStatus;

}  // namespace

ObjectTracker::ObjectTracker(const PoseRefinerParameters& parameters,
                             std::unique_ptr<ObjectSearch> search, tf2::BufferCore* transforms,
                             Report report, Clock clock)
    : parameters_(parameters),
      transforms_(transforms),
      report_(std::move(report)),
      clock_(std::move(clock)),
      search_(std::move(search)),
      input_(parameters.image_is_rectified),
      tf_(*transforms, parameters.frames),
      state_(parameters.rules) {}

std::uint32_t ObjectTracker::readClock() {
  // Read under the lock: a thread that is held up between reading and telling would come with a
  // time of before that of another thread.
  std::lock_guard<std::mutex> lock(mutex_);
  if (state_.clockIs(clock_())) {
    ++clock_jumps_;
    running_.requestCancel();
    transforms_->clear();
  }
  return clock_jumps_;
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

void ObjectTracker::offer(const InitialPose& initial_pose) {
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

std::future<void> ObjectTracker::offerModel(std::shared_ptr<const Field> field, bool same_looks) {
  std::lock_guard<std::mutex> lock(mutex_);
  pending_models_.push_back({std::move(field), same_looks, {}});
  if (!same_looks) running_.requestCancel();
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
      const std::shared_ptr<const Field> before = std::exchange(field_, model.field);
      if (before && model.same_looks &&
          before->metadata.metres_per_unit == field_->metadata.metres_per_unit) {
        Pose T_U_V = before->metadata.T_O_U.inverse() * field_->metadata.T_O_U;
        T_U_V.t *= field_->metadata.metres_per_unit;
        state_.objectFrameMoved(T_U_V);
      } else {
        state_.modelIsReady();
      }
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
  running_.requestCancel();
}

void ObjectTracker::setEnabled(bool enabled) {
  std::lock_guard<std::mutex> lock(mutex_);
  state_.setEnabled(enabled);
  if (!enabled) running_.requestCancel();
}

void ObjectTracker::change(const PoseRefinerParameters& parameters) {
  std::lock_guard<std::mutex> lock(mutex_);
  changed_ = parameters;
}

void ObjectTracker::applyChange() {
  std::optional<PoseRefinerParameters> changed;
  {
    std::lock_guard<std::mutex> lock(mutex_);
    changed.swap(changed_);
    if (!changed) return;
    state_.setRules(changed->rules);
  }
  parameters_.rules = changed->rules;
  parameters_.initial = changed->initial;
  parameters_.tracking = changed->tracking;
  search_->configure(parameters_.initial.refiner, parameters_.tracking.refiner);
}

void ObjectTracker::stop() {
  std::lock_guard<std::mutex> lock(mutex_);
  stopping_ = true;
  running_.requestCancel();
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

/// Nothing: the image came before time jumped back.
std::optional<FrameDecision> ObjectTracker::decide(const CameraFrame& frame,
                                                   const std_msgs::Header& header,
                                                   const CancellationToken& stop) {
  std::lock_guard<std::mutex> lock(mutex_);
  if (frame.clock_jumps != clock_jumps_) return std::nullopt;
  const FrameDecision decision = state_.decide(header.stamp, header.frame_id);
  running_ = stop;
  if (stopping_) stop.requestCancel();
  if (decision.clock_jumped) transforms_->clear();
  return decision;
}

std::optional<FrameResult> ObjectTracker::process(const CameraFrame& frame) {
  std_msgs::Header header = frame.image->header;
  header.frame_id = withoutSlash(header.frame_id);
  const CancellationToken stop;
  applyChange();
  const std::optional<FrameDecision> decision = decide(frame, header, stop);
  if (!decision) return std::nullopt;
  reportChange(header);
  if (!decision->start) return std::nullopt;

  FrameResult result;
  try {
    refine(frame, header, *decision, stop, &result);
  } catch (const InputError& e) {
    std::lock_guard<std::mutex> lock(mutex_);
    state_.notTrusted(decision->ticket, e.reason(), e.what());
  } catch (const std::exception& e) {
    std::lock_guard<std::mutex> lock(mutex_);
    state_.failed(decision->ticket, e.what());
  }
  ++processed_;
  result.status = statusOf(result, frame, *decision, header);
  return result;
}

/// Status after an image, with what concerns this image alone.
RefinementStatus ObjectTracker::statusOf(const FrameResult& result, const CameraFrame& frame,
                                         const FrameDecision& decision,
                                         const std_msgs::Header& header) {
  RefinementStatus status = statusNow(header);
  reported_ = Condition{status.state, status.reason, status.message};
  if (status.reason == Status::REASON_NONE && !result.no_transform.empty()) {
    status.reason = Status::REASON_NO_TRANSFORM;
    status.message = result.no_transform;
  } else if (status.reason == Status::REASON_NONE && decision.initial_pose_ignored) {
    status.reason = Status::REASON_PRIOR_IGNORED;
    status.message = "the object is tracked: an initial pose was ignored (~initial_pose_policy)";
  }
  status.score = static_cast<float>(result.refinement.score);
  status.visible_fraction = static_cast<float>(result.refinement.visible_fraction);
  status.refinement_s = static_cast<float>(result.refinement.seconds);
  status.latency_s = static_cast<float>((ros::WallTime::now() - frame.arrival).toSec());
  status.image_age_s = static_cast<float>(clock_().toSec() - header.stamp.toSec());
  return status;
}

/// The start as the library has it; nothing: it cannot be used, and the state says why.
std::optional<Prior> ObjectTracker::prepare(const std_msgs::Header& header,
                                            const FrameDecision& decision,
                                            const CancellationToken& stop) {
  const InitialPose& start = *decision.start;
  try {
    const Prior prior =
        priorFrom(start, tf_.startInCamera(start, header.frame_id, header.stamp, stop),
                  field_->metadata, start.tracked ? parameters_.tracking : parameters_.initial);
    return decision.before ? predict(prior, header, decision, stop) : prior;
  } catch (const InputError& e) {
    const bool from_outside = !start.tracked && !decision.recovering;
    const bool unknown_frame = e.reason() == Status::REASON_NO_TRANSFORM && from_outside;
    std::lock_guard<std::mutex> lock(mutex_);
    state_.startRefused(decision.ticket,
                        unknown_frame ? std::uint8_t{Status::REASON_PRIOR_NO_FRAME} : e.reason(),
                        e.what());
    return std::nullopt;
  }
}

/// Where the object is if it goes on as it did; where it was if TF knows nothing of the pose
/// before.
Prior ObjectTracker::predict(const Prior& last, const std_msgs::Header& header,
                             const FrameDecision& decision, const CancellationToken& stop) {
  const InitialPose& before = *decision.before;
  const double now = header.stamp.toSec(), since = decision.start->stamp.toSec();
  const double time_ratio = (now - since) / (since - before.stamp.toSec());
  try {
    const Pose T_C_U = tf_.startInCamera(before, header.frame_id, header.stamp, stop);
    const Pose T_O_C = ObjectFrame::inMetres(field_->metadata).cameraInModel(T_C_U);
    return predictConstantVelocity(last, T_O_C, time_ratio, field_->metadata);
  } catch (const InputError&) {
    return last;
  }
}

void ObjectTracker::refine(const CameraFrame& frame, const std_msgs::Header& header,
                           const FrameDecision& decision, const CancellationToken& stop,
                           FrameResult* result) {
  // Looked up now: when the refinement is done, the buffer may have forgotten.
  std::optional<Pose> T_W_C;
  try {
    T_W_C = tf_.cameraInOutput(header.frame_id, header.stamp, stop);
  } catch (const InputError& e) {
    result->no_transform = e.what();
  }
  const std::optional<Prior> prior = prepare(header, decision, stop);
  if (!prior) return;
  result->field = field_;
  ImageMasks masks = frame.masks;
  if (!parameters_.masks.usedFrom(decision.start->tracked)) masks.object = nullptr;
  result->observation =
      std::make_shared<const Observation>(input_.observe(*frame.image, *frame.info, masks));
  result->refinement = search_->search(*result->observation, *prior, decision.start->tracked, stop);
  const Trust trust = conclude(header, decision, result->refinement);
  result->found = trust != Trust::kOutdated && result->refinement.outcome == Outcome::kRefined;
  if (T_W_C && result->found) place(header, *T_W_C, trust == Trust::kTrusted, result);
}

ObjectTracker::Trust ObjectTracker::conclude(const std_msgs::Header& header,
                                             const FrameDecision& decision,
                                             const Refinement& refinement) {
  const std::uint64_t ticket = decision.ticket;
  const auto [reason, message] = checkTrust(refinement, decision.start->tracked, parameters_.rules);
  const Pose T_C_U = ObjectFrame::inMetres(field_->metadata).objectInCamera(refinement.T_O_C);
  std::lock_guard<std::mutex> lock(mutex_);
  if (reason == Status::REASON_NONE) {
    const bool current = state_.trusted(ticket, T_C_U, header.frame_id, header.stamp);
    return current ? Trust::kTrusted : Trust::kOutdated;
  }
  const bool current = state_.notTrusted(ticket, reason, message);
  return current ? Trust::kNotTrusted : Trust::kOutdated;
}

void ObjectTracker::place(const std_msgs::Header& header, const Pose& T_W_C, bool trusted,
                          FrameResult* result) const {
  const FieldMetadata& object = field_->metadata;
  std_msgs::Header placed = header;
  placed.frame_id = tf_.outputFrame(header.frame_id);
  result->hypotheses = toMessage(result->refinement.hypotheses, T_W_C, object);
  result->hypotheses.object = object.name;
  result->hypotheses.header = placed;
  if (!trusted) return;
  result->pose.emplace();
  result->pose->header = placed;
  result->pose->pose = toMessage(result->refinement, T_W_C, object);
}

}  // namespace nerf_pose_refiner
