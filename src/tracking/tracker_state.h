// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "nerf_pose_refiner/pose.h"
#include "tracking/settings.h"
#include "tracking/status.h"
#include "tracking/timed_pose.h"

namespace nerf_pose_refiner {

/// How to process an image.
struct ImageDecision {
  std::optional<TimedPose> start;     ///< start pose of the refinement; empty: skip the image
  bool after_failure = false;         ///< the object was not found in the image after `start`
  bool detect = false;                ///< there is no start: search the whole image
  std::uint64_t ticket = 0;           ///< to be returned with the result
  bool clock_jumped = false;          ///< time went back: earlier transforms are invalid
  bool confirmed = false;             ///< a pose of the track that goes on was trusted
  bool recovering = false;            ///< the start is the last pose of a lost object
  bool initial_pose_ignored = false;  ///< because the object is tracked
};

/// The state machine of tracking, without threads or images: from which pose each image is refined,
/// and how the result changes the state. Not thread-safe.
class TrackerState {
 public:
  /// If images are older than those before by more than this, time has jumped back. If one is older
  /// by less, it is late, and is skipped.
  static constexpr double kClockJump_s = 0.5;
  /// So many late images in a row are reported: their stamps do not go on.
  static constexpr int kLateImages = 5;

  explicit TrackerState(const TrackingRules& rules) : rules_(rules) {}

  /// Replaces the rules.
  void setRules(const TrackingRules& rules) { rules_ = rules; }

  /// Sets the present time. Call it before all other calls, and regularly: without images the
  /// object is lost.
  /// @return true if the clock has jumped back: whatever is older must be forgotten.
  bool updateClock(std::int64_t now_ns);

  void modelIsLoading();
  /// A model is in use. Poses of the model before it are forgotten.
  void modelIsReady();
  /// The object's own frame has changed from U to V: stored poses are converted. (An initial pose
  /// that has not been used yet refers to V.)
  /// @param T_U_V [m]
  void objectFrameMoved(const Pose& T_U_V);
  /// The model could not be loaded; the present one stays in use.
  void modelFailed(TrackReason reason, const std::string& message);

  /// Keeps an initial pose for the first image that is not older; it replaces an earlier one.
  void offer(const TimedPose& initial_pose);
  /// Reports an invalid initial pose.
  void refuseInitialPose(TrackReason reason, const std::string& message);
  /// Whether an image of this time would be skipped because there is no start pose.
  bool needsInitialPose(std::int64_t stamp_ns) const;

  /// A usable image has arrived.
  void imageArrived();
  /// An image has arrived that cannot be used.
  void imageRefused(TrackReason reason, const std::string& message);

  /// Decides how to process an image. If the decision has a start, a refinement begins; otherwise
  /// a detection may. An image whose stamp jumps is skipped: if the next one goes on from there,
  /// time has jumped, else the stamp was wrong.
  ImageDecision decide(const ImageStamp& image);

  /// How long the detection took that ends now [s]: the next one waits accordingly.
  void detectionTook(double seconds) { last_detection_s_ = seconds; }

  /// The start pose cannot be used: a failure of the track or of the initial pose.
  void startRefused(std::uint64_t ticket, TrackReason reason, const std::string& message);
  /// A refinement ended with a trusted pose. @param T_C_U [m]
  /// @return false if the result is obsolete, for instance after a reset: discard it.
  bool trusted(std::uint64_t ticket, const Pose& T_C_U);
  /// A refinement ended with a pose that is not to be published, but to track from. A track that
  /// begins with one is not confirmed before the first trusted pose. With a doubtful one, a lost
  /// object stays lost.
  /// @return false if it is out of date, as `trusted`.
  /// @param doubtful only so many in a row, then it counts as a failure; where detection may find
  /// the object elsewhere, so do the images of a track that is not confirmed.
  bool goesOn(std::uint64_t ticket, const Pose& T_C_U, TrackReason reason,
              const std::string& message, bool doubtful);
  /// A refinement ended without a trusted pose. @return false if the result is obsolete.
  bool notTrusted(std::uint64_t ticket, TrackReason reason, const std::string& message);
  /// A refinement ended with an exception.
  void failed(std::uint64_t ticket, const std::string& message);

  /// Forgets all poses.
  void reset();
  /// While disabled, images and initial poses are ignored.
  void setEnabled(bool enabled);

  const TrackCondition& condition() const { return condition_; }

 private:
  /// The running refinement.
  struct Running {
    std::uint64_t ticket;
    ImageStamp image;
    std::optional<TimedPose> start;  ///< nothing: it is looked for everywhere
  };

  /// An initial pose, and the time on the clock when it came.
  struct Offer {
    TimedPose initial_pose;
    std::int64_t at_ns;
  };

  void setCondition(TrackState state, TrackReason reason = TrackReason::kNone,
                    const std::string& message = "");
  void waitWithReason(TrackReason reason, const std::string& message);
  void forgetPoses();
  void lose(TrackReason reason, const std::string& message);
  std::optional<TimedPose> chooseStart(std::int64_t stamp_ns, ImageDecision* decision);
  bool stampJumps(std::int64_t stamp_ns) const;
  bool takesStamp(std::int64_t stamp_ns, ImageDecision* decision);
  void skip(const std::string& message);
  void timeWentBackTo(std::int64_t stamp_ns);
  bool wasSentAfterJump(const Offer& offer, std::int64_t stamp_ns) const;
  bool initialPoseIsDue(std::int64_t stamp_ns, ImageDecision* decision);
  bool recoveryIsOver(std::int64_t stamp_ns) const;
  bool detectionIsDue(std::int64_t stamp_ns) const;
  void countMiss(TrackReason reason, const std::string& message);
  std::optional<Running> end(std::uint64_t ticket);
  void countFailure(const TimedPose& start, TrackReason reason, const std::string& message);

  TrackingRules rules_;
  TrackCondition condition_ = {TrackState::kNoModel, TrackReason::kNone,
                               "no object is chosen: load or register one"};
  std::optional<TrackCondition> before_refusal_;  ///< restored by the next usable image
  std::optional<TrackCondition> before_skips_;  ///< restored by the next image that is not skipped
  bool has_model_ = false;
  bool enabled_ = true;
  std::optional<TimedPose> initial_pose_;  ///< not used yet
  std::optional<Offer> old_offer_;         ///< the last one that was old when it came
  std::optional<TimedPose> last_;          ///< the last trusted pose, while the object is tracked
  /// While lost: the pose to search around, the last trusted one or an initial one that failed.
  std::optional<TimedPose> recovery_start_;
  bool confirmed_ = false;                         ///< a pose of the track was trusted
  int doubts_ = 0;                                 ///< images in a row that `goesOn` counts
  std::optional<std::int64_t> last_detection_ns_;  ///< stamp of the image it looked at
  double last_detection_s_ = 0;                    ///< that it took
  int failures_ = 0;                               ///< untrusted images since the last trusted one
  std::optional<std::int64_t> last_stamp_ns_;      ///< of the last image that was not skipped
  double last_lead_s_ = 0;                         ///< by which that was ahead of the clock [s]
  std::optional<std::int64_t> jumped_stamp_ns_;    ///< of the image before, skipped for its jump
  int late_images_ = 0;                            ///< skipped since the last other one
  std::int64_t clock_ns_ = 0;                      ///< the time of the last updateClock
  std::int64_t last_arrival_ns_ = 0;               ///< of the last image, on that clock
  std::optional<Running> running_;
  std::uint64_t tickets_ = 0;  ///< number of tickets so far
};

}  // namespace nerf_pose_refiner
