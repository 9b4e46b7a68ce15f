// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "backend/backend.h"
#include "refinement/field_refiner.h"
#include "tracking/motion_filter.h"
#include "tracking/object_search.h"
#include "tracking/settings.h"
#include "tracking/status.h"
#include "tracking/tracker_state.h"
#include "tracking/transforms.h"
#include "tracking/view_window.h"

namespace nerf_pose_refiner {

struct Judgement;

/// An image to be tracked in.
struct TrackerImage {
  ImageStamp at;
  /// Prepares the observation. Called by the tracking thread, only if the image is refined.
  /// @param use_mask whether to use a mask of the object, if there is one.
  /// @throws InputError if the image cannot be used.
  std::function<Observation(bool use_mask)> observe;
  CancellationToken cancel = {};  ///< of this image alone: the tracker cancels it, too
  std::uint32_t clock_jumps = 0;  ///< for `process`: readClock at the image's arrival
};

/// The result for one image.
struct TrackOutcome : TrackStatus {
  bool refined = false;  ///< there was a start pose; false: the image was skipped
  bool found = false;    ///< there is a pose, trusted or not
  bool trusted = false;  ///< there is a pose, and it is trusted
  Pose T_C_O_m;          ///< the object's own frame U in the camera [m]
  /// Covariance of T_C_O_m: position, then rotation about the camera's axes [m^2, rad^2].
  Matrix6 covariance = Matrix6::Zero();
  double score = 0;            ///< 0..1, how well the pose explains the image
  bool from_last = false;      ///< the search started from the pose in the image before
  std::optional<Prior> prior;  ///< of the search [model units]
  std::shared_ptr<const Observation> observation;  ///< that was searched; null: none
  std::shared_ptr<const Field> field;              ///< of the object that was searched for
  Refinement refinement;  ///< result of the search [model units], all hypotheses
};

/// A tracker's connections to its surroundings. The defaults suit a program that calls `track` with
/// the images of one camera.
struct TrackerConnections {
  std::shared_ptr<Transforms> transforms = std::make_shared<CameraFrameOnly>();
  /// The present time on the clock of the stamps; empty: the stamp of the newest image.
  std::function<std::int64_t()> clock_ns = {};
  /// Called by the tracking thread for each change of state that is not the result of a refinement.
  std::function<void(const TrackStatus&)> report = {};
};

/// Tracks one object from image to image.
///
///     ObjectTracker tracker(backend, object, TrackerSettings());
///     tracker.offer({T_C_O_m, "camera"});
///     const TrackOutcome result = tracker.track({{"camera", stamp_ns}, observe});
///     if (result.trusted) use(result.T_C_O_m, result.covariance);
///
/// Only one thread, the tracking thread, may call the methods of its group below. Any thread may
/// call the others, which return at once.
class ObjectTracker {
 public:
  /// @param object must have a metric scale. @throws std::invalid_argument if it has none, and what
  /// the backend throws when it loads the object.
  ObjectTracker(std::shared_ptr<Backend> backend, std::shared_ptr<const Field> object,
                const TrackerSettings& settings, DetectionSetup detection = {});

  /// Tracks nothing until a model is offered.
  ObjectTracker(std::unique_ptr<ObjectSearch> search, const TrackerSettings& settings,
                TrackerConnections connections = {});

  /// Reads the clock, if there is one. Call it for each message, before the message is used, and
  /// regularly in between.
  /// @return how often the clock has jumped back. Images from before a jump are not used.
  std::uint32_t readClock();

  /// Reports a usable image, which will be processed soon.
  void imageArrived();
  /// Reports an image that cannot be used. The status shows it until the next usable image.
  void imageRefused(TrackReason reason, const std::string& message);

  /// Keeps an initial pose for the first image that is not older than it.
  void offer(const TimedPose& initial_pose);
  void refuseInitialPose(TrackReason reason, const std::string& message);

  void modelIsLoading();
  void modelFailed(TrackReason reason, const std::string& message);
  /// Hands over a model with metric scale. The future becomes ready when the model is in use.
  /// @param same_appearance only the metadata differs from those of the present model: the track
  /// continues, unless the scale has changed.
  std::future<void> offerModel(std::shared_ptr<const Field> field, bool same_appearance = false);

  void reset();
  void setEnabled(bool enabled);
  /// Replaces the settings from the next image on.
  void change(const TrackerSettings& settings);
  /// Interrupts the running refinement and all later ones. Call it before the tracking thread is
  /// joined.
  void stop();

  /// @name For the tracking thread
  /// @{

  /// Whether `track` would skip an image of this time because there is no start pose.
  bool needsInitialPose(std::int64_t stamp_ns);

  /// Processes an image that has just arrived: readClock, imageArrived and process in one call.
  TrackOutcome track(TrackerImage image);

  /// Processes an image that arrived earlier, unless time has jumped back since then.
  TrackOutcome process(const TrackerImage& image);

  /// Puts the offered models into use.
  void applyModels();

  /// Reports the state if it has changed since the last report. @param at time of the change.
  void reportChange(const ImageStamp& at);
  /// @}

 private:
  struct PendingModel {
    std::shared_ptr<const Field> field;
    bool same_appearance = false;
    std::promise<void> done;
  };

  std::uint32_t updateClock(std::int64_t now_ns);
  std::int64_t timeOfImage(std::int64_t stamp_ns) const;
  void use(const PendingModel& model);
  void applyChange();
  std::optional<ImageDecision> decide(const TrackerImage& image);
  std::optional<Prior> prepare(const TrackerImage& image, const ImageDecision& decision);
  Prior expected(const Prior& start, const Pose& T_C_U, const TrackerImage& image,
                 const ImageDecision& decision);
  void fuse(TrackOutcome* result);
  void refine(const TrackerImage& image, const ImageDecision& decision, TrackOutcome* result);
  bool tell(const Judgement& judgement, std::uint64_t ticket, const Pose& T_C_U);
  void conclude(const ImageDecision& decision, std::int64_t stamp_ns, TrackOutcome* result);
  void concludeStatus(const ImageStamp& at, const ImageDecision& decision, TrackOutcome* result);
  TrackStatus statusNow(const ImageStamp& at) const;

  TrackerConnections connections_;

  // Used by the tracking thread only.
  std::unique_ptr<ObjectSearch> search_;
  TrackerSettings settings_;
  ViewWindow window_;
  MotionFilter motion_;
  std::optional<TrackCondition> reported_;
  std::uint32_t processed_ = 0;

  mutable std::mutex mutex_;  ///< guards all below; only the tracking thread writes field_
  TrackerState state_;
  std::uint32_t clock_jumps_ = 0;
  CancellationToken running_;  ///< of the image that is being refined
  bool stopping_ = false;
  std::optional<TrackerSettings> changed_;  ///< settings for the next image
  std::shared_ptr<const Field> field_;      ///< in use
  std::deque<PendingModel> pending_models_;
};

}  // namespace nerf_pose_refiner
