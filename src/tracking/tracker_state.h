// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "nerf_pose_refiner/pose.h"
#include "nerf_pose_refiner/track_status.h"
#include "tracking/settings.h"
#include "tracking/timed_pose.h"

namespace nerf_pose_refiner {

/// What to do with an image.
struct ImageDecision {
  std::optional<TimedPose> start;     ///< refine from here; nothing: leave the image alone
  std::optional<TimedPose> previous;  ///< the trusted pose before `start`, to predict from
  bool detect = false;                ///< there is no start: look for the object everywhere
  std::uint64_t ticket = 0;           ///< to be handed back with the result
  bool clock_jumped = false;          ///< time went back: transforms from before are worthless
  bool recovering = false;            ///< the start is where a lost object was seen last
  bool initial_pose_ignored = false;  ///< one came while the object is tracked
};

/// The rules of tracking, without threads or images: which images are refined from where, and what
/// the outcome makes of the state. Not thread-safe.
class TrackerState {
 public:
  /// An image that is older than the one before by more than this means that time jumped back; one
  /// that is older by less came late, and is left alone.
  static constexpr double kClockJump_s = 0.5;

  explicit TrackerState(const TrackingRules& rules) : rules_(rules) {}

  /// Other rules, from now on.
  void setRules(const TrackingRules& rules) { rules_ = rules; }

  /// Tells the time, before all else and now and then: a track without images is lost.
  /// @return true if the clock jumped back: forget what is older.
  bool clockIs(std::int64_t now_ns);

  void modelIsLoading();
  /// From now on there is a model. Poses of the model before, if there was one, are forgotten.
  void modelIsReady();
  /// What users mean by the object's frame is V instead of U from now on: poses that are kept move
  /// with it. (An initial pose that was not used yet is of the new one.)
  /// @param T_U_V [m]
  void objectFrameMoved(const Pose& T_U_V);
  /// The model could not be had; one that is there already stays in use.
  void modelFailed(TrackReason reason, const std::string& message);

  /// Keeps an initial pose for the first image that is not older; the newest pose counts.
  void offer(const TimedPose& initial_pose);
  /// Reports an initial pose that makes no sense.
  void refuseInitialPose(TrackReason reason, const std::string& message);
  /// Whether an image of this time would be left alone for lack of a pose to start from.
  bool needsInitialPose(std::int64_t stamp_ns) const;

  /// A usable image came.
  void imageArrived();
  /// An image that cannot be used came.
  void imageRefused(TrackReason reason, const std::string& message);

  /// Decides on an image. If there is a start, a refinement begins; or else a detection may.
  ImageDecision decide(const ImageStamp& image);

  /// The start cannot be used: the reason counts against the track or the initial pose.
  void startRefused(std::uint64_t ticket, TrackReason reason, const std::string& message);
  /// A refinement ended well. @param T_C_U [m]
  /// @return false if it is out of date, after a reset say: drop the result.
  bool trusted(std::uint64_t ticket, const Pose& T_C_U);
  /// A refinement ended without a pose to believe in. @return false if it is out of date.
  bool notTrusted(std::uint64_t ticket, TrackReason reason, const std::string& message);
  /// A refinement ended with an exception.
  void failed(std::uint64_t ticket, const std::string& message);

  /// Forgets all poses.
  void reset();
  /// While disabled, images and initial poses are ignored.
  void setEnabled(bool enabled);

  const TrackCondition& condition() const { return condition_; }

 private:
  /// A refinement under way.
  struct Running {
    std::uint64_t ticket;
    ImageStamp image;
    std::optional<TimedPose> start;  ///< nothing: it is looked for everywhere
  };

  void become(TrackState state, TrackReason reason = TrackReason::kNone,
              const std::string& message = "");
  void waitBecause(TrackReason reason, const std::string& message);
  void forgetPoses();
  void lose(TrackReason reason, const std::string& message);
  std::optional<TimedPose> startFor(std::int64_t stamp_ns, ImageDecision* decision);
  void timeWentBackTo(std::int64_t stamp_ns);
  bool initialPoseIsDue(std::int64_t stamp_ns, ImageDecision* decision);
  bool recoveryIsOver(std::int64_t stamp_ns) const;
  bool detectionIsDue(std::int64_t stamp_ns) const;
  void countMiss(TrackReason reason, const std::string& message);
  std::optional<Running> end(std::uint64_t ticket);
  void countFailure(const TimedPose& start, TrackReason reason, const std::string& message);

  TrackingRules rules_;
  TrackCondition condition_;
  std::optional<TrackCondition> before_refusal_;  ///< restored by the next usable image
  bool has_model_ = false;
  bool enabled_ = true;
  std::optional<TimedPose> initial_pose_;  ///< from outside, not yet used
  std::optional<TimedPose> last_;          ///< the last trusted pose, while the object is tracked
  std::optional<TimedPose> previous_;      ///< what last_ was found from, if that was tracked, too
  /// While lost: where to look for the object, the last trusted pose or an initial one of no avail.
  std::optional<TimedPose> recovery_start_;
  std::optional<std::int64_t> last_detection_ns_;  ///< stamp of the image it looked at
  int failures_ = 0;                               ///< untrusted images since the last trusted one
  std::optional<std::int64_t> last_stamp_ns_;      ///< of the images decided on
  std::int64_t clock_ns_ = 0;                      ///< the time, when last told
  std::int64_t last_arrival_ns_ = 0;               ///< of an image, by that clock
  std::optional<Running> running_;
  std::uint64_t tickets_ = 0;  ///< given out so far
};

}  // namespace nerf_pose_refiner
