// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/nodelet/tracker_state.h"

#include <utility>

namespace nerf_pose_refiner {

using Status = RefinementStatus;

namespace {

/// As doubles, for differences of ros::Time overflow with stamps that make no sense.
double secondsBetween(const ros::Time& from, const ros::Time& to) {
  return to.toSec() - from.toSec();
}

}  // namespace

void TrackerState::become(std::uint8_t state, std::uint8_t reason, const std::string& message) {
  condition_ = {state, reason, message};
  before_refusal_.reset();
}

void TrackerState::waitBecause(std::uint8_t reason, const std::string& message) {
  if (has_model_) become(Status::STATE_WAITING, reason, message);
}

void TrackerState::forgetPoses() {
  prior_.reset();
  last_.reset();
  anchor_.reset();
  failures_ = 0;
  running_ = 0;
}

/// The track ends; the object is looked for where it was seen last.
void TrackerState::lose(std::uint8_t reason, const std::string& message) {
  if (last_) {
    anchor_ = std::exchange(last_, std::nullopt);
    anchor_->tracked = false;  // as from an initial pose: a wide search, and the higher threshold
  }
  become(Status::STATE_LOST, reason, message);
}

void TrackerState::modelIsLoading() {
  if (!has_model_) become(Status::STATE_LOADING);
}

void TrackerState::modelIsReady() {
  // An initial pose that came while the first model was loading is still good.
  if (has_model_) forgetPoses();
  has_model_ = true;
  const char* message = enabled_ && !prior_ ? "waiting for an initial pose" : "";
  waitBecause(enabled_ ? Status::REASON_NONE : Status::REASON_DISABLED, message);
}

void TrackerState::objectFrameMoved(const Pose& T_U_V) {
  for (std::optional<InitialPose>* kept : {&last_, &before_last_, &anchor_}) {
    if (!*kept) continue;
    InitialPose& start = **kept;
    if (start.covariance) start.covariance = atPoint(*start.covariance, start.T_P_U.R * T_U_V.t);
    start.T_P_U = start.T_P_U * T_U_V;
  }
}

void TrackerState::modelFailed(std::uint8_t reason, const std::string& message) {
  if (!has_model_) become(Status::STATE_ERROR, reason, message);
}

void TrackerState::offer(const InitialPose& initial_pose) {
  if (!enabled_) return;
  const bool another = prior_.has_value();
  prior_ = initial_pose;
  // What is said of images that cannot be used goes on being said; so does what is wrong with one
  // initial pose after the other.
  Condition& condition = before_refusal_ ? *before_refusal_ : condition_;
  if (condition.state == Status::STATE_LOST ||
      (condition.state == Status::STATE_WAITING && !another)) {
    condition = {Status::STATE_WAITING, Status::REASON_NONE,
                 "an initial pose came: waiting for an image that is not older"};
  }
}

void TrackerState::refuseInitialPose(std::uint8_t reason, const std::string& message) {
  become(condition_.state, reason, message);
}

void TrackerState::imageArrived() {
  last_arrival_ = clock_;
  if (!before_refusal_) return;
  condition_ = *before_refusal_;
  before_refusal_.reset();
}

void TrackerState::imageRefused(std::uint8_t reason, const std::string& message) {
  const Condition before = before_refusal_.value_or(condition_);
  become(condition_.state, reason, message);
  before_refusal_ = before;
}

bool TrackerState::clockIs(const ros::Time& now) {
  const bool jumped = secondsBetween(now, clock_) > kClockJump_s;
  clock_ = now;
  if (jumped) {
    timeWentBackTo(now);
    last_stamp_ = last_arrival_ = ros::Time();
  } else if (last_ && rules_.image_timeout_s > 0 &&
             secondsBetween(last_arrival_, clock_) > rules_.image_timeout_s) {
    lose(Status::REASON_NO_IMAGES, "no image came for ~image_timeout_s");
  }
  return jumped;
}

void TrackerState::timeWentBackTo(const ros::Time& stamp) {
  last_.reset();
  anchor_.reset();
  failures_ = 0;
  running_ = 0;
  // An initial pose that fits the new time was sent after the jump.
  if (prior_ && secondsBetween(stamp, prior_->stamp) > kClockJump_s) prior_.reset();
  waitBecause(Status::REASON_CLOCK_JUMPED, "time went back: waiting for a new initial pose");
}

/// Whether prior_ is to be used for the image; drops it if it never will be.
bool TrackerState::initialPoseIsDue(const ros::Time& stamp, FrameDecision* decision) {
  if (!prior_) return false;
  const ros::Time since = prior_->stamp.isZero() ? stamp : prior_->stamp;
  if (since > stamp) {
    if (!last_) {
      waitBecause(Status::REASON_PRIOR_IN_FUTURE,
                  "the initial pose is newer than the images (do all use the same clock?)");
    }
    return false;
  }
  const bool too_old = secondsBetween(since, stamp) > rules_.initial_pose_max_age_s;
  if (last_ && rules_.initial_pose_policy == InitialPosePolicy::kWhenNotTracking) {
    decision->initial_pose_ignored = true;
  } else if (too_old) {
    become(last_ ? Status::STATE_TRACKING : Status::STATE_WAITING, Status::REASON_PRIOR_TOO_OLD,
           "the initial pose is older than the image by more than ~initial_pose_max_age_s");
  } else {
    return true;
  }
  prior_.reset();
  return false;
}

FrameDecision TrackerState::decide(const ros::Time& stamp, const std::string& frame_id) {
  FrameDecision decision;
  if (!last_stamp_.isZero() && stamp <= last_stamp_) {
    if (secondsBetween(stamp, last_stamp_) <= kClockJump_s) return decision;
    decision.clock_jumped = true;
    timeWentBackTo(stamp);
  }
  last_stamp_ = stamp;
  if (!has_model_ || !enabled_) return decision;
  // Another camera: where the object is in its frame is not known.
  if (last_ && last_->frame_id != frame_id) {
    last_.reset();
    anchor_.reset();
    waitBecause(Status::REASON_RESET, "the camera's frame changed to '" + frame_id + "'");
  }
  decision.start = startFor(stamp, &decision);
  if (!decision.start) return decision;
  running_ = decision.ticket = ++tickets_;
  running_start_ = *decision.start;
  return decision;
}

/// From where to refine an image.
std::optional<InitialPose> TrackerState::startFor(const ros::Time& stamp, FrameDecision* decision) {
  if (initialPoseIsDue(stamp, decision)) {
    // An earlier track goes on if nothing comes of the new pose.
    anchor_.reset();
    become(Status::STATE_REFINING);
    InitialPose start = *std::exchange(prior_, std::nullopt);
    if (start.stamp.isZero()) start.stamp = stamp;
    return start;
  }
  if (last_) {
    // After an image that was not trusted the object may be where it was seen last.
    if (rules_.predict && failures_ == 0) decision->before = before_last_;
    return last_;
  }
  if (anchor_ && secondsBetween(anchor_->stamp, stamp) > rules_.recover_s) anchor_.reset();
  decision->recovering = anchor_.has_value();
  return anchor_;
}

bool TrackerState::end(std::uint64_t ticket) {
  if (running_ == 0 || ticket != running_) return false;
  running_ = 0;
  return true;
}

void TrackerState::countFailure(std::uint8_t reason, const std::string& message) {
  if (last_ && ++failures_ <= rules_.max_failures) {
    become(Status::STATE_TRACKING, reason, message);
    return;
  }
  if (!last_ && !rules_.once) anchor_ = running_start_;
  lose(reason, message);
}

void TrackerState::startRefused(std::uint64_t ticket, std::uint8_t reason,
                                const std::string& message) {
  if (!end(ticket)) return;
  if (running_start_.tracked) {
    countFailure(reason, message);
  } else if (anchor_) {
    become(Status::STATE_LOST, reason, message);
  } else {
    become(last_ ? Status::STATE_TRACKING : Status::STATE_WAITING, reason, message);
  }
}

bool TrackerState::trusted(std::uint64_t ticket, const Pose& T_C_U, const std::string& frame_id,
                           const ros::Time& stamp) {
  if (!end(ticket)) return false;
  failures_ = 0;
  anchor_.reset();
  if (rules_.once) {
    last_.reset();
    become(Status::STATE_WAITING);
    return true;
  }
  before_last_ = running_start_.tracked ? last_ : std::nullopt;
  last_ = InitialPose();
  last_->T_P_U = T_C_U;
  last_->frame_id = frame_id;
  last_->stamp = stamp;
  last_->tracked = true;
  become(Status::STATE_TRACKING);
  return true;
}

bool TrackerState::notTrusted(std::uint64_t ticket, std::uint8_t reason,
                              const std::string& message) {
  if (!end(ticket)) return false;
  countFailure(reason, message);
  return true;
}

void TrackerState::failed(std::uint64_t ticket, const std::string& message) {
  if (!end(ticket)) return;
  countFailure(Status::REASON_INTERNAL, message);
  condition_.state = Status::STATE_ERROR;
}

void TrackerState::reset() {
  forgetPoses();
  waitBecause(Status::REASON_RESET, "reset on request: waiting for an initial pose");
}

void TrackerState::setEnabled(bool enabled) {
  if (enabled == enabled_) return;
  enabled_ = enabled;
  forgetPoses();
  if (enabled) {
    waitBecause(Status::REASON_NONE, "");
  } else {
    waitBecause(Status::REASON_DISABLED, "disabled on request");
  }
}

}  // namespace nerf_pose_refiner
