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

#include "nerf_pose_refiner/track_status.h"
#include "refinement/field_refiner.h"
#include "tracking/object_search.h"
#include "tracking/settings.h"
#include "tracking/tracker_state.h"
#include "tracking/transforms.h"

namespace nerf_pose_refiner {

/// An image that may be refined.
struct TrackerImage {
  ImageStamp at;
  /// Makes what the refiner looks at; called only if the image is refined, by the thread that
  /// tracks. @param use_mask the object's mask counts, if there is one.
  /// @throws InputError if the image cannot be used.
  std::function<Observation(bool use_mask)> observe;
  CancellationToken cancel = {};  ///< interrupts the refinement of this image
  std::uint32_t clock_jumps = 0;  ///< for `process`: as readClock said when the image came
};

/// What came of an image.
struct TrackOutcome : TrackStatus {
  bool refined = false;  ///< there was a pose to start from; false: the image was left alone
  bool found = false;    ///< there is a pose, trusted or not
  bool trusted = false;  ///< there is a pose to believe in
  Pose T_C_O_m;          ///< the object's own frame, as its users mean it, in the camera [m]
  /// Of T_C_O_m as REP-103 has it, about the camera's axes [m^2, rad^2].
  Matrix6 covariance = Matrix6::Zero();
  double score = 0;            ///< 0..1, how well the pose explains the image
  bool from_last = false;      ///< the search began with the pose of the image before
  std::optional<Prior> prior;  ///< where it began, model units
  std::shared_ptr<const Observation> observation;  ///< what was looked at; null: nothing
  std::shared_ptr<const Field> field;              ///< what was looked for
  Refinement refinement;                           ///< in model units, with all hypotheses
};

/// What a tracker is connected to. The defaults are right for a program that calls `track` with
/// the images of one camera.
struct TrackerConnections {
  std::shared_ptr<Transforms> transforms = std::make_shared<CameraFrameOnly>();
  /// The time, on the clock of the stamps; empty: it is that of the newest image.
  std::function<std::int64_t()> clock_ns = {};
  /// Called by the thread that tracks with each change that does not end a refinement.
  std::function<void(const TrackStatus&)> report = {};
};

/// Tracks one object from image to image.
///
///     ObjectTracker tracker(backend, object, TrackerSettings());
///     tracker.offer({T_C_O_m, "camera"});
///     const TrackOutcome result = tracker.track({{"camera", stamp_ns}, observe});
///     if (result.trusted) use(result.T_C_O_m, result.covariance);
///
/// One thread, the one that tracks, calls `track` and the methods below it; all others may be
/// called from any thread and return at once.
class ObjectTracker {
 public:
  /// @param object with metric scale. @throws std::invalid_argument if it has none, and what the
  /// backend throws when it loads the object.
  ObjectTracker(std::shared_ptr<Backend> backend, std::shared_ptr<const Field> object,
                const TrackerSettings& settings, DetectionSetup detection = {});

  /// Tracks nothing until a model is offered.
  ObjectTracker(std::unique_ptr<ObjectSearch> search, const TrackerSettings& settings,
                TrackerConnections connections = {});

  /// Reads the clock, if there is one: to be called with each message, before it is used, and now
  /// and then.
  /// @return how often the clock has jumped back so far. An image of before a jump is worthless.
  std::uint32_t readClock();

  /// A usable image came, to be processed soon.
  void imageArrived();
  /// An image that cannot be used came: the status says so until a better one comes.
  void imageRefused(TrackReason reason, const std::string& message);

  /// Keeps an initial pose for the first image that is not older.
  void offer(const TimedPose& initial_pose);
  void refuseInitialPose(TrackReason reason, const std::string& message);

  void modelIsLoading();
  void modelFailed(TrackReason reason, const std::string& message);
  /// Hands over a model with metric scale. The future is ready when it is in use.
  /// @param same_looks of the one before, with other metadata: the track goes on, unless the scale
  /// is another one.
  std::future<void> offerModel(std::shared_ptr<const Field> field, bool same_looks = false);

  void reset();
  void setEnabled(bool enabled);
  /// Takes over other settings from the next image on.
  void change(const TrackerSettings& settings);
  /// Interrupts a refinement under way, for good: before the thread that tracks is joined.
  void stop();

  /// @name By the thread that tracks.
  /// @{

  /// Whether `track` would leave an image of this time alone for lack of a pose to start from.
  bool needsInitialPose(std::int64_t stamp_ns);

  /// An image that has just come: readClock, imageArrived and process in one.
  TrackOutcome track(TrackerImage image);

  /// Refines an image that came before, if there is a pose to start from and time did not jump back
  /// since.
  TrackOutcome process(const TrackerImage& image);

  /// Takes over the models that were offered.
  void applyModels();

  /// Reports the state if it changed since the last report. @param at the time of the change.
  void reportChange(const ImageStamp& at);
  /// @}

 private:
  struct PendingModel {
    std::shared_ptr<const Field> field;
    bool same_looks = false;
    std::promise<void> done;
  };

  std::uint32_t timeIs(std::int64_t now_ns);
  std::int64_t timeOfImage(std::int64_t stamp_ns) const;
  void use(const PendingModel& model);
  void applyChange();
  std::optional<ImageDecision> decide(const TrackerImage& image);
  std::optional<Prior> prepare(const TrackerImage& image, const ImageDecision& decision);
  Prior predict(const Prior& last, const TrackerImage& image, const ImageDecision& decision);
  void refine(const TrackerImage& image, const ImageDecision& decision, TrackOutcome* result);
  void conclude(const ImageDecision& decision, TrackOutcome* result);
  void concludeStatus(const ImageStamp& at, const ImageDecision& decision, TrackOutcome* result);
  TrackStatus statusNow(const ImageStamp& at) const;

  TrackerConnections connections_;

  // Of the thread that tracks.
  std::unique_ptr<ObjectSearch> search_;
  TrackerSettings settings_;
  std::optional<TrackCondition> reported_;
  std::uint32_t processed_ = 0;

  mutable std::mutex mutex_;  ///< guards all below; field_ is written by the thread that tracks
  TrackerState state_;
  std::uint32_t clock_jumps_ = 0;
  CancellationToken running_;  ///< of the refinement under way
  bool stopping_ = false;
  std::optional<TrackerSettings> changed_;  ///< since the last image
  std::shared_ptr<const Field> field_;      ///< in use
  std::deque<PendingModel> pending_models_;
};

}  // namespace nerf_pose_refiner
