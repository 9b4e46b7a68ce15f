// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "backend/backend.h"
#include "evaluation/sequence.h"
#include "ros/bag/bag_sequence.h"
#include "ros/conversions/camera_input.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {

/// Where the search in an image starts.
enum class StartMode {
  kPerturbed,  ///< from the true pose, made wrong at random: the same for the same seed and image
  kRecorded,   ///< from the newest initial pose of the bag
  kDetected,   ///< nowhere: the object is looked for in the whole image
};

struct BagEvaluationSettings {
  int every = 1;       ///< n-th image is refined
  int first = 0;       ///< image
  int most = 0;        ///< images; 0: all
  bool track = false;  ///< from the last trusted result, and from `start` where there is none
  StartMode start = StartMode::kPerturbed;
  double start_rotation_deg = 15;    ///< half width per axis, about the object's centre
  double start_translation = 0.15;   ///< half width per axis of the camera [object diameters]
  double start_max_age_s = 1;        ///< of a recorded initial pose
  std::string preset = "keyframes";  ///< of the search from a start
  double search_rotation_deg = kSearchRotation_deg;  ///< half width of it
  double search_translation = kSearchTranslation;    ///< the same [object diameters]
  std::string track_preset = "keyframes";            ///< of the search from the last pose
  double track_rotation_deg = 5;
  double track_translation = 0.05;
  /// The node's; `once` is set by `track`.
  TrackingRules rules;
  std::string landmarks_path;  ///< file that keeps the object's landmarks; empty: none
  bool image_is_rectified = false;
  DepthSettings depth;
  CameraSettings cameras;     ///< their topics are the bag's
  ViewWindowSettings window;  ///< where the bag knows the camera's place, with `track` alone
  int points = 1000;          ///< of the surface, for ADD, ADD-S and reprojection
  std::uint64_t seed = 1;

  /// Of the tracker that works through the images.
  TrackerSettings tracker() const;

  /// @throws std::invalid_argument naming what is out of range.
  void validate() const;
};

struct BagEvaluationResult {
  std::vector<EvaluatedFrame> frames;
  std::map<std::string, int> skipped;        ///< images that could not be evaluated, by reason
  int masked = 0;                            ///< images that came with a mask
  int with_depth = 0;                        ///< images in whose pose depth took part
  std::map<std::string, int> depth_refused;  ///< images in which it did not, by reason
  int with_cameras = 0;                      ///< images in whose pose further cameras took part
  /// Images of further cameras that did not, by reason.
  std::map<std::string, int> cameras_refused;
  int with_window = 0;                        ///< images in whose pose past images took part
  std::map<std::string, int> window_refused;  ///< past images that did not, by reason
  int points = 0;                             ///< of the surface, as many as were found
};

/// Tracks the object through the images of a recorded sequence, or refines them one by one, and
/// compares the poses with the truth. No clock has a say in the poses: the same bag, model,
/// settings and processor give the same numbers, latencies apart.
class BagEvaluation {
 public:
  /// @throws std::invalid_argument for settings that make no sense or a model without a scale.
  BagEvaluation(const BagSequence& bag, std::shared_ptr<Backend> backend,
                std::shared_ptr<const Field> field, const BagEvaluationSettings& settings);

  /// @param progress called for each image: its number and the last result; may be empty.
  /// @throws std::runtime_error naming topic and frame of what is damaged; Cancelled.
  BagEvaluationResult run(const std::function<void(const EvaluatedFrame&)>& progress,
                          const CancellationToken& cancellation);

 private:
  void evaluate(const BagFrame& frame, const CancellationToken& cancellation);
  std::optional<Pose> startOf(const BagFrame& frame, const Pose& true_T_C_U) const;
  bool offerStart(const BagFrame& frame, const Pose& true_T_C_U);
  Observation observe(const BagFrame& frame);
  void addSideViews(const BagFrame& frame, Observation* observation);
  void count(const Refinement& refinement);
  void compareWithCovariance(const Refinement& found, const Pose& true_T_C_U,
                             EvaluatedFrame* evaluated) const;
  EvaluatedFrame compare(const TrackOutcome& result, const Pose& true_T_C_U) const;

  const BagSequence& bag_;
  BagEvaluationSettings settings_;
  std::shared_ptr<Backend> backend_;
  std::shared_ptr<const Field> field_;
  CameraInput input_;
  std::vector<CameraInput> side_inputs_;  ///< of the bag's further cameras
  std::size_t side_views_ = 0;            ///< of the last observation
  std::unique_ptr<ObjectTracker> tracker_;
  std::optional<EvaluatedObject> object_;
  BagEvaluationResult result_;
};

const char* outcomeText(Outcome outcome);

}  // namespace nerf_pose_refiner
