// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/tracker_state.h"

#include <algorithm>
#include <cstdio>
#include <utility>

namespace nerf_pose_refiner {
namespace {

double secondsBetween(std::int64_t from_ns, std::int64_t to_ns) {
  return 1e-9 * static_cast<double>(to_ns - from_ns);
}

}  // namespace

void TrackerState::setCondition(TrackState state, TrackReason reason, const std::string& message) {
  condition_ = {state, reason, message};
  before_refusal_.reset();
  before_skips_.reset();
}

void TrackerState::waitWithReason(TrackReason reason, const std::string& message) {
  if (has_model_) setCondition(TrackState::kWaiting, reason, message);
}

void TrackerState::forgetPoses() {
  initial_pose_.reset();
  old_offer_.reset();
  last_.reset();
  recovery_start_.reset();
  last_detection_ns_.reset();
  failures_ = doubts_ = 0;
  running_.reset();
}

/// Ends the track. The object is searched for around its last pose.
void TrackerState::lose(TrackReason reason, const std::string& message) {
  doubts_ = 0;
  if (last_) {
    recovery_start_ = std::exchange(last_, std::nullopt);
    // A wide search and the higher threshold, as from an initial pose.
    recovery_start_->tracked = false;
  }
  setCondition(TrackState::kLost, reason, message);
}

void TrackerState::modelIsLoading() {
  if (!has_model_) setCondition(TrackState::kLoading);
}

void TrackerState::modelIsReady() {
  // An initial pose that arrived while the first model was loading is still valid.
  if (has_model_) forgetPoses();
  has_model_ = true;
  const char* message = enabled_ && !initial_pose_ ? "waiting for an initial pose" : "";
  waitWithReason(enabled_ ? TrackReason::kNone : TrackReason::kDisabled, message);
}

void TrackerState::objectFrameMoved(const Pose& T_U_V) {
  for (std::optional<TimedPose>* kept : {&last_, &recovery_start_}) {
    if (!*kept) continue;
    TimedPose& start = **kept;
    if (start.covariance) start.covariance = atPoint(*start.covariance, start.T_P_U.R * T_U_V.t);
    start.T_P_U = start.T_P_U * T_U_V;
  }
}

void TrackerState::modelFailed(TrackReason reason, const std::string& message) {
  if (!has_model_) setCondition(TrackState::kError, reason, message);
}

void TrackerState::offer(const TimedPose& initial_pose) {
  if (!enabled_ || rules_.start == TrackStart::kDetect) return;
  const bool another = initial_pose_.has_value();
  initial_pose_ = initial_pose;
  if (secondsBetween(initial_pose.stamp_ns, clock_ns_) > kClockJump_s) {
    old_offer_ = {initial_pose, clock_ns_};
  }
  // The status keeps showing that images are unusable, and why one initial pose after another was
  // refused.
  TrackCondition& condition = before_refusal_ ? *before_refusal_ : condition_;
  if (condition.state == TrackState::kLost ||
      (condition.state == TrackState::kWaiting && !another)) {
    condition = {TrackState::kWaiting, TrackReason::kNone,
                 "received an initial pose, waiting for an image that is not older"};
  }
}

void TrackerState::refuseInitialPose(TrackReason reason, const std::string& message) {
  setCondition(condition_.state, reason, message);
}

void TrackerState::imageArrived() {
  last_arrival_ns_ = clock_ns_;
  if (!before_refusal_) return;
  condition_ = *before_refusal_;
  before_refusal_.reset();
}

void TrackerState::imageRefused(TrackReason reason, const std::string& message) {
  const TrackCondition before = before_refusal_.value_or(before_skips_.value_or(condition_));
  setCondition(condition_.state, reason, message);
  before_refusal_ = before;
}

bool TrackerState::updateClock(std::int64_t now_ns) {
  const bool jumped = secondsBetween(now_ns, clock_ns_) > kClockJump_s;
  if (jumped) {
    timeWentBackTo(now_ns);
    last_stamp_ns_.reset();
    last_arrival_ns_ = 0;
  }
  clock_ns_ = now_ns;
  if (!jumped && last_ && rules_.image_timeout_s > 0 &&
      secondsBetween(last_arrival_ns_, clock_ns_) > rules_.image_timeout_s) {
    char text[60];
    std::snprintf(text, sizeof text, "no image came for %g s", rules_.image_timeout_s);
    lose(TrackReason::kNoImages, text);
  }
  return jumped;
}

void TrackerState::timeWentBackTo(std::int64_t stamp_ns) {
  last_.reset();
  recovery_start_.reset();
  last_detection_ns_.reset();
  failures_ = doubts_ = 0;
  running_.reset();
  if (initial_pose_ && secondsBetween(stamp_ns, initial_pose_->stamp_ns) > kClockJump_s) {
    initial_pose_.reset();
  }
  // It may have been spent on an image that was taken before the jump.
  if (old_offer_ && wasSentAfterJump(*old_offer_, stamp_ns)) {
    initial_pose_ = old_offer_->initial_pose;
  }
  old_offer_.reset();
  waitWithReason(TrackReason::kClockJumped, "time went back: waiting for a new initial pose");
}

/// Whether an initial pose that was old when it came is one of the time that has begun, as at the
/// start of a bag that loops. Called while clock_ns_ is still the time before the jump.
bool TrackerState::wasSentAfterJump(const Offer& offer, std::int64_t stamp_ns) const {
  constexpr double kJumpIsSeen_s = 1;  // after the first message of the new time
  const double age = secondsBetween(offer.initial_pose.stamp_ns, stamp_ns);
  return secondsBetween(offer.at_ns, clock_ns_) <= kJumpIsSeen_s && age >= -kClockJump_s &&
         age <= rules_.initial_pose_max_age_s;
}

/// Whether to use the initial pose for the image; discards a pose that can never be used.
bool TrackerState::initialPoseIsDue(std::int64_t stamp_ns, ImageDecision* decision) {
  if (!initial_pose_) return false;
  const std::int64_t since_ns = initial_pose_->stamp_ns == 0 ? stamp_ns : initial_pose_->stamp_ns;
  if (since_ns > stamp_ns) {
    if (!last_) {
      waitWithReason(TrackReason::kPriorInFuture,
                     "the initial pose is newer than the images (do all use the same clock?)");
    }
    return false;
  }
  const bool too_old = secondsBetween(since_ns, stamp_ns) > rules_.initial_pose_max_age_s;
  if (last_ && rules_.initial_pose_policy == InitialPosePolicy::kWhenNotTracking) {
    decision->initial_pose_ignored = true;
  } else if (too_old) {
    setCondition(last_ ? TrackState::kTracking : TrackState::kWaiting, TrackReason::kPriorTooOld,
                 "the initial pose is too old: it was taken too long before the image");
  } else {
    return true;
  }
  initial_pose_.reset();
  return false;
}

bool TrackerState::recoveryIsOver(std::int64_t stamp_ns) const {
  return !recovery_start_ || secondsBetween(recovery_start_->stamp_ns, stamp_ns) > rules_.recover_s;
}

bool TrackerState::needsInitialPose(std::int64_t stamp_ns) const {
  return has_model_ && enabled_ && !initial_pose_ && !last_ && recoveryIsOver(stamp_ns) &&
         !detectionIsDue(stamp_ns);
}

/// Whether an image without a pose from outside or from the image before is looked at everywhere.
bool TrackerState::detectionIsDue(std::int64_t stamp_ns) const {
  if (rules_.start == TrackStart::kInitialPose) return false;
  if (!last_detection_ns_) return true;
  const double since_s = secondsBetween(*last_detection_ns_, stamp_ns);
  return since_s >= std::max(1 / rules_.detect_rate_hz, last_detection_s_ / rules_.detect_share);
}

/// Whether a stamp is not where those before it lead: well before them, or well ahead of them and
/// of the clock. (A camera whose clock is ahead is so with each image.)
bool TrackerState::stampJumps(std::int64_t stamp_ns) const {
  const double step_s = secondsBetween(*last_stamp_ns_, stamp_ns);
  const double lead_s = secondsBetween(clock_ns_, stamp_ns);
  return step_s < -kClockJump_s || std::min({step_s, lead_s, lead_s - last_lead_s_}) > kClockJump_s;
}

/// Reports an image that is skipped for its stamp.
void TrackerState::skip(const std::string& message) {
  if (!has_model_ || !enabled_) return;
  const TrackCondition before = before_skips_.value_or(condition_);
  setCondition(condition_.state, TrackReason::kBadImage, message);
  before_skips_ = before;
}

/// Whether an image's stamp goes on from those before it.
bool TrackerState::takesStamp(std::int64_t stamp_ns, ImageDecision* decision) {
  if (last_stamp_ns_ && stampJumps(stamp_ns)) {
    const bool goes_on = jumped_stamp_ns_ && stamp_ns > *jumped_stamp_ns_;
    jumped_stamp_ns_ = stamp_ns;
    if (!goes_on) {
      skip(
          "the stamp of an image jumps: the image is skipped, unless the next one goes on from it");
      return false;
    }
    if (stamp_ns < *last_stamp_ns_) {
      decision->clock_jumped = true;
      timeWentBackTo(stamp_ns);
    }
  } else if (last_stamp_ns_ && stamp_ns <= *last_stamp_ns_) {
    if (++late_images_ >= kLateImages) {
      skip("the stamps of the images stand still, or are older than one before: they are skipped");
    }
    return false;
  }
  if (before_skips_) condition_ = *std::exchange(before_skips_, std::nullopt);
  jumped_stamp_ns_.reset();
  late_images_ = 0;
  last_stamp_ns_ = stamp_ns;
  last_lead_s_ = secondsBetween(clock_ns_, stamp_ns);
  return true;
}

ImageDecision TrackerState::decide(const ImageStamp& image) {
  ImageDecision decision;
  if (!takesStamp(image.stamp_ns, &decision)) return decision;
  if (!has_model_ || !enabled_) return decision;
  // Another camera: the object's pose in its frame is not known.
  if (!rules_.cameras_change && last_ && last_->frame_id != image.camera_frame) {
    last_.reset();
    recovery_start_.reset();
    waitWithReason(TrackReason::kReset,
                   "the camera's frame changed to '" + image.camera_frame + "'");
  }
  decision.start = chooseStart(image.stamp_ns, &decision);
  const bool known = last_ || (decision.start && !decision.recovering);
  if (!known && detectionIsDue(image.stamp_ns)) {
    decision.detect = true;
    decision.start.reset();
    decision.recovering = false;
    last_detection_ns_ = image.stamp_ns;
    last_detection_s_ = 0;
  }
  if (!decision.start && !decision.detect) return decision;
  decision.confirmed = decision.start && decision.start->tracked && confirmed_;
  decision.ticket = ++tickets_;
  running_ = {decision.ticket, image, decision.start};
  return decision;
}

/// The start pose for an image.
std::optional<TimedPose> TrackerState::chooseStart(std::int64_t stamp_ns, ImageDecision* decision) {
  if (initialPoseIsDue(stamp_ns, decision)) {
    // An earlier track continues if the search from the new pose fails.
    recovery_start_.reset();
    setCondition(TrackState::kRefining);
    TimedPose start = *std::exchange(initial_pose_, std::nullopt);
    if (start.stamp_ns == 0) start.stamp_ns = stamp_ns;
    return start;
  }
  if (last_) {
    decision->after_failure = failures_ > 0;
    return last_;
  }
  if (recoveryIsOver(stamp_ns)) recovery_start_.reset();
  decision->recovering = recovery_start_.has_value();
  return recovery_start_;
}

/// The refinement that ends; empty: its result is obsolete.
std::optional<TrackerState::Running> TrackerState::end(std::uint64_t ticket) {
  if (!running_ || ticket != running_->ticket) return std::nullopt;
  return std::exchange(running_, std::nullopt);
}

/// @param start start pose of the refinement.
void TrackerState::countFailure(const TimedPose& start, TrackReason reason,
                                const std::string& message) {
  if (last_ && ++failures_ <= rules_.max_failures) {
    setCondition(TrackState::kTracking, reason, message);
    return;
  }
  if (!last_ && !rules_.once) recovery_start_ = start;
  lose(reason, message);
}

/// Detection found nothing.
void TrackerState::countMiss(TrackReason reason, const std::string& message) {
  const bool lost = recovery_start_ || condition_.state == TrackState::kLost;
  setCondition(lost ? TrackState::kLost : TrackState::kWaiting, reason, message);
}

void TrackerState::startRefused(std::uint64_t ticket, TrackReason reason,
                                const std::string& message) {
  const std::optional<Running> ended = end(ticket);
  if (!ended || !ended->start) return;
  if (ended->start->tracked) {
    countFailure(*ended->start, reason, message);
  } else if (recovery_start_) {
    setCondition(TrackState::kLost, reason, message);
  } else {
    setCondition(last_ ? TrackState::kTracking : TrackState::kWaiting, reason, message);
  }
}

bool TrackerState::trusted(std::uint64_t ticket, const Pose& T_C_U) {
  const std::optional<Running> ended = end(ticket);
  if (!ended) return false;
  failures_ = 0;
  doubts_ = 0;
  confirmed_ = true;
  recovery_start_.reset();
  if (rules_.once) {
    last_.reset();
    setCondition(TrackState::kWaiting);
    return true;
  }
  last_ = TimedPose{T_C_U, ended->image.camera_frame, ended->image.stamp_ns,
                    /*tracked=*/true, std::nullopt};
  setCondition(TrackState::kTracking);
  return true;
}

bool TrackerState::goesOn(std::uint64_t ticket, const Pose& T_C_U, TrackReason reason,
                          const std::string& message, bool doubtful) {
  // So many doubtful images are worth a failure. What detection finds again soon is given up
  // sooner.
  const bool detects = rules_.start != TrackStart::kInitialPose;
  const int doubts_of_failure = detects ? 10 : 30;
  const bool has_start = running_ && running_->start;  // no detection
  const bool goes_on = has_start && running_->start->tracked;
  const bool confirmed = confirmed_ && goes_on;
  // Of a track that was never trusted, detection may know better.
  const bool counts = doubtful || (detects && !confirmed);
  const int doubts = counts ? (goes_on ? doubts_ : 0) + 1 : 0;
  const bool is_over = doubts > doubts_of_failure * (rules_.max_failures + 1);
  // Of a lost object it would end the search: that around the last pose, and in whole images.
  const bool is_guess = doubtful && recovery_start_;
  if (!has_start || rules_.once || is_over || is_guess) return notTrusted(ticket, reason, message);
  if (!trusted(ticket, T_C_U)) return false;
  confirmed_ = confirmed;
  doubts_ = doubts;
  setCondition(TrackState::kTracking, reason, message);
  return true;
}

bool TrackerState::notTrusted(std::uint64_t ticket, TrackReason reason,
                              const std::string& message) {
  const std::optional<Running> ended = end(ticket);
  if (!ended) return false;
  if (ended->start) {
    countFailure(*ended->start, reason, message);
  } else {
    countMiss(reason, message);
  }
  return true;
}

void TrackerState::failed(std::uint64_t ticket, const std::string& message) {
  if (notTrusted(ticket, TrackReason::kInternal, message)) condition_.state = TrackState::kError;
}

void TrackerState::reset() {
  forgetPoses();
  waitWithReason(TrackReason::kReset, "reset on request: waiting for an initial pose");
}

void TrackerState::setEnabled(bool enabled) {
  if (enabled == enabled_) return;
  enabled_ = enabled;
  forgetPoses();
  if (enabled) {
    waitWithReason(TrackReason::kNone, "");
  } else {
    waitWithReason(TrackReason::kDisabled, "disabled on request");
  }
}

}  // namespace nerf_pose_refiner
