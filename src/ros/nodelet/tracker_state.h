// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/RefinementStatus.h>
#include <ros/time.h>

#include <cstdint>
#include <optional>
#include <string>

#include "nerf_pose_refiner/pose.h"
#include "refinement/covariance.h"
#include "ros/conversions/parameters.h"

namespace nerf_pose_refiner {

/// What ~status says of the tracker.
struct Condition {
  std::uint8_t state = RefinementStatus::STATE_NO_MODEL;
  std::uint8_t reason = RefinementStatus::REASON_NONE;
  std::string message;  ///< the reason in words

  bool operator==(const Condition& other) const {
    return state == other.state && reason == other.reason && message == other.message;
  }
  bool operator!=(const Condition& other) const { return !(*this == other); }
};

/// Where the object was at some time: from outside, or from the last trusted refinement.
struct InitialPose {
  Pose T_P_U;            ///< the object's frame U, as its users mean it, in frame P [m]
  std::string frame_id;  ///< P
  ros::Time stamp;       ///< zero: the time of the image it is used for
  bool tracked = false;  ///< from the last refinement, not from outside
  /// Of it as REP-103 has it, in the axes of P [m^2, rad^2]: how wide to search. Nothing: as the
  /// parameters say.
  std::optional<Matrix6> covariance;
};

/// What to do with an image.
struct FrameDecision {
  std::optional<InitialPose> start;   ///< refine from here; nothing: leave the image alone
  std::optional<InitialPose> before;  ///< the trusted pose before `start`: the object goes on so
  std::uint64_t ticket = 0;           ///< to be handed back with the result
  bool clock_jumped = false;          ///< time went back: transforms from before are worthless
  bool recovering = false;            ///< the start is where a lost object was seen last
  bool initial_pose_ignored = false;  ///< one came while the object is tracked
};

/// The rules of tracking, without threads, ROS graph or images: which images are refined from
/// where, and what the outcome makes of the state. Not thread-safe.
class TrackerState {
 public:
  /// An image that is older than the one before by more than this means that time jumped back; one
  /// that is older by less came late, and is left alone.
  static constexpr double kClockJump_s = 0.5;

  explicit TrackerState(const TrackingRules& rules) : rules_(rules) {}

  /// Other rules, from now on.
  void setRules(const TrackingRules& rules) { rules_ = rules; }

  /// Tells the time of the ROS clock, before all else and now and then: a track without images is
  /// lost. @return true if the clock jumped back: forget what is older.
  bool clockIs(const ros::Time& now);

  void modelIsLoading();
  /// From now on there is a model. Poses of the model before, if there was one, are forgotten.
  void modelIsReady();
  /// What users mean by the object's frame is V instead of U from now on: poses that are kept
  /// follow. (An initial pose that was not used yet is of the new one.)
  /// @param T_U_V [m]
  void objectFrameMoved(const Pose& T_U_V);
  /// The model could not be had; one that is there already stays in use.
  void modelFailed(std::uint8_t reason, const std::string& message);

  /// Keeps an initial pose for the first image that is not older; the newest pose counts.
  void offer(const InitialPose& initial_pose);
  /// Reports an initial pose that makes no sense.
  void refuseInitialPose(std::uint8_t reason, const std::string& message);

  /// A usable image came.
  void imageArrived();
  /// An image that cannot be used came.
  void imageRefused(std::uint8_t reason, const std::string& message);

  /// Decides on an image. If there is a start, a refinement begins.
  FrameDecision decide(const ros::Time& stamp, const std::string& frame_id);

  /// The start cannot be used: the reason counts against the track or the initial pose.
  void startRefused(std::uint64_t ticket, std::uint8_t reason, const std::string& message);
  /// A refinement ended well. @return false if it is out of date, after a reset say: drop the
  /// result.
  bool trusted(std::uint64_t ticket, const Pose& T_C_U, const std::string& frame_id,
               const ros::Time& stamp);
  /// A refinement ended without a pose to believe in. @return false if it is out of date.
  bool notTrusted(std::uint64_t ticket, std::uint8_t reason, const std::string& message);
  /// A refinement ended with an exception.
  void failed(std::uint64_t ticket, const std::string& message);

  /// Forgets all poses.
  void reset();
  /// While disabled, images and initial poses are ignored.
  void setEnabled(bool enabled);

  const Condition& condition() const { return condition_; }

 private:
  void become(std::uint8_t state, std::uint8_t reason = RefinementStatus::REASON_NONE,
              const std::string& message = "");
  void waitBecause(std::uint8_t reason, const std::string& message);
  void forgetPoses();
  void lose(std::uint8_t reason, const std::string& message);
  std::optional<InitialPose> startFor(const ros::Time& stamp, FrameDecision* decision);
  void timeWentBackTo(const ros::Time& stamp);
  bool initialPoseIsDue(const ros::Time& stamp, FrameDecision* decision);
  bool end(std::uint64_t ticket);
  void countFailure(std::uint8_t reason, const std::string& message);

  TrackingRules rules_;
  Condition condition_;
  std::optional<Condition> before_refusal_;  ///< restored by the next usable image
  bool has_model_ = false;
  bool enabled_ = true;
  std::optional<InitialPose> prior_;        ///< from outside, not yet used
  std::optional<InitialPose> last_;         ///< the last trusted pose, while it may be followed
  std::optional<InitialPose> before_last_;  ///< what last_ was found from, if that was tracked, too
  /// While lost: where to look for the object, the last trusted pose or an initial one of no avail.
  std::optional<InitialPose> anchor_;
  int failures_ = 0;           ///< untrusted images since then
  ros::Time last_stamp_;       ///< of the images decided on; zero: none
  ros::Time clock_;            ///< the ROS clock, when last told
  ros::Time last_arrival_;     ///< of an image, by the ROS clock
  std::uint64_t running_ = 0;  ///< ticket of the refinement under way; 0: none
  InitialPose running_start_;  ///< what it started from
  std::uint64_t tickets_ = 0;  ///< given out so far
};

}  // namespace nerf_pose_refiner
