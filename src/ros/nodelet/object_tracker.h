// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <nerf_pose_refiner/PoseHypothesisArray.h>
#include <nerf_pose_refiner/RefinementStatus.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <optional>
#include <string>

#include "ros/conversions/camera_input.h"
#include "ros/conversions/parameters.h"
#include "ros/conversions/tf_bridge.h"
#include "ros/nodelet/tracker_state.h"
#include "tracking/object_search.h"

namespace nerf_pose_refiner {

/// An image as it came.
struct CameraFrame {
  sensor_msgs::ImageConstPtr image;
  sensor_msgs::CameraInfoConstPtr info;
  ros::WallTime arrival;
  std::uint32_t clock_jumps = 0;  ///< as readClock said when it came
  ImageMasks masks = {};          ///< of the same stamp
};

/// What came of one refined image.
struct FrameResult {
  RefinementStatus status;
  /// In ~output_frame, if it is trusted.
  std::optional<geometry_msgs::PoseWithCovarianceStamped> pose;
  PoseHypothesisArray hypotheses;  ///< in ~output_frame; empty if that could not be reached
  std::string no_transform;        ///< why not
  std::shared_ptr<const Observation> observation;  ///< what was looked at; null: nothing
  std::shared_ptr<const Field> field;              ///< what was looked for
  Refinement refinement;
  bool found = false;  ///< refinement.T_O_C is where the object was found, trusted or not
};

/// Follows one object from image to image. One thread, the worker, calls `process` and
/// `applyModels`; all other methods may be called from any thread and return at once.
class ObjectTracker {
 public:
  /// Called by the worker with each change of the state that does not end a refinement.
  using Report = std::function<void(const RefinementStatus&)>;
  using Clock = std::function<ros::Time()>;

  /// @param transforms filled by another thread; outlives this object.
  /// @param clock the ROS clock.
  ObjectTracker(const PoseRefinerParameters& parameters, std::unique_ptr<ObjectSearch> search,
                tf2::BufferCore* transforms, Report report, Clock clock = ros::Time::now);

  /// Reads the clock: to be called with each message, before it is used, and now and then.
  /// @return how often the clock has jumped back so far. An image of before a jump is worthless.
  std::uint32_t readClock();

  /// Whether an image may be processed; if not, ~status will say why.
  /// @return nothing if it may, else the reason in words.
  std::optional<std::string> refusal(const sensor_msgs::Image& image,
                                     const sensor_msgs::CameraInfo& info);

  void offer(const InitialPose& initial_pose);
  void refuseInitialPose(std::uint8_t reason, const std::string& message);

  void modelIsLoading();
  void modelFailed(std::uint8_t reason, const std::string& message);
  /// Hands over a model with metric scale. The future is ready when it is in use.
  /// @param same_looks of the one before, with other metadata: the track goes on, unless the scale
  /// is another one.
  std::future<void> offerModel(std::shared_ptr<const Field> field, bool same_looks = false);

  void reset();
  void setEnabled(bool enabled);
  /// Takes over the searches and the rules of tracking, from the next image on.
  void change(const PoseRefinerParameters& parameters);
  /// Interrupts a refinement under way, for good: before the worker is joined.
  void stop();

  /// @name By the worker.
  /// @{
  void applyModels();
  /// Refines an image if there is a pose to start from and time did not jump back since it came.
  /// The caller publishes what came of it.
  std::optional<FrameResult> process(const CameraFrame& frame);
  /// Reports the state if it changed since the last report.
  void reportChange(const std_msgs::Header& header);
  /// @}

 private:
  struct PendingModel {
    std::shared_ptr<const Field> field;
    bool same_looks = false;
    std::promise<void> done;
  };

  enum class Trust { kOutdated, kNotTrusted, kTrusted };

  void applyChange();
  std::optional<FrameDecision> decide(const CameraFrame& frame, const std_msgs::Header& header,
                                      const CancellationToken& stop);
  std::optional<Prior> prepare(const std_msgs::Header& header, const FrameDecision& decision,
                               const CancellationToken& stop);
  Prior predict(const Prior& last, const std_msgs::Header& header, const FrameDecision& decision,
                const CancellationToken& stop);
  void refine(const CameraFrame& frame, const std_msgs::Header& header,
              const FrameDecision& decision, const CancellationToken& stop, FrameResult* result);
  Trust conclude(const std_msgs::Header& header, const FrameDecision& decision,
                 const Refinement& refinement);
  void place(const std_msgs::Header& header, const Pose& T_W_C, bool trusted,
             FrameResult* result) const;
  RefinementStatus statusOf(const FrameResult& result, const CameraFrame& frame,
                            const FrameDecision& decision, const std_msgs::Header& header);
  RefinementStatus statusNow(const std_msgs::Header& header) const;

  PoseRefinerParameters parameters_;  ///< searches and rules: the worker's; the rest is constant
  tf2::BufferCore* transforms_;
  Report report_;
  Clock clock_;

  // The worker's own.
  std::unique_ptr<ObjectSearch> search_;
  CameraInput input_;
  TfBridge tf_;
  std::optional<Condition> reported_;
  std::uint32_t processed_ = 0;

  mutable std::mutex mutex_;  ///< guards all below; field_ is written by the worker alone
  TrackerState state_;
  std::uint32_t clock_jumps_ = 0;
  CancellationToken running_;  ///< of the refinement under way
  bool stopping_ = false;
  std::optional<PoseRefinerParameters> changed_;  ///< since the last image
  std::shared_ptr<const Field> field_;            ///< in use
  std::deque<PendingModel> pending_models_;
};

}  // namespace nerf_pose_refiner
