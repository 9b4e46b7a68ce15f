// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "backend/backend.h"
#include "backend/cost_counters.h"
#include "backend/loaded_field.h"
#include "backend/pose_solver.h"
#include "nerf_pose_refiner/observation.h"
#include "refinement/covariance.h"
#include "refinement/settings.h"

namespace nerf_pose_refiner {

/// A rough pose of the object, and how far it may be from the true one.
struct Prior {
  Pose T_O_C;  ///< camera in the object's model frame, model units
  /// Half width of the search per axis [rad]; alignment may move up to twice as far.
  double rotation_rad = kSearchRotation_rad;
  double translation = kSearchTranslation;  ///< the same for the position [object diameters]
  bool rotate_about_object = true;  ///< the rotation is about the object's centre, in the axes of
                                    ///< O; false: about the camera, in its own (the paper's)

  /// @throws std::invalid_argument for a pose that is not rigid or an invalid width.
  void validate() const;

  /// Whether the width and centre of the search are the same.
  bool isAsWideAs(const Prior& other) const;
};

enum class Outcome {
  kRefined,    ///< a pose was found; `score` says how well it explains the image
  kNoOverlap,  ///< the prior is entirely outside the image
  kBadSize,    ///< the object would be far larger than the image, or only a few pixels wide
  kDiverged,   ///< no hypothesis survived
  kCancelled,  ///< a cancellation was requested
};

/// One line of the trace: the state after a stage.
struct TraceEntry {
  std::string stage;
  double seconds = 0;
  CostCounters work;  ///< of this stage
  int live = 0;       ///< number of live hypotheses
  double best_loss = 0;
  Pose best_T_O_C;
};

struct RefinementRun;  // refinement/schedule.h

/// A pose by one of several images.
struct LonePose {
  Pose T_O_C;                            ///< [model units]
  Matrix6 covariance = Matrix6::Zero();  ///< @see poseCovariance
};

struct Refinement {
  Outcome outcome = Outcome::kDiverged;
  Pose T_O_C;  ///< best pose [model units]; among symmetric poses, the nearest to the prior
  /// 0..1: how likely the pose is right, by Hypothesis::score and what is known of the object.
  double score = 0;
  /// The same without regard to the covariance: how likely the search ended at the right place,
  /// even if the image does not say exactly where that is. Nothing: as the score.
  std::optional<double> found_probability;
  /// Probability that it is the right one of the poses that look alike, @see LookAlikes. Nothing:
  /// the object is not taken for itself.
  std::optional<double> unmistaken;
  /// Whether the track had taken the object for itself until now: what lies between its last pose
  /// and this one is no motion.
  bool is_turned = false;
  /// The best score of wrong poses in the same image, @see RolledScores. Nothing: too few of them
  /// could be compared with it.
  std::optional<double> rolled_score;
  /// Of the object's colours in the image, @see chromaticDifference; nothing: not compared.
  std::optional<double> chromatic_difference;
  double visible_fraction = 0;             ///< 0..1
  std::optional<double> mask_agreement;    ///< @see maskAgreement; nothing: there was no mask
  DepthReport depth;                       ///< what became of the observation's depth
  std::vector<SideViewReport> side_views;  ///< of the observation's side views, in their order
  /// By the observation's own image alone, if there are side views and it shows the object.
  std::optional<LonePose> own;
  Matrix6 covariance = Matrix6::Zero();  ///< of the best pose; @see poseCovariance
  HypothesisTable hypotheses;            ///< those of the last stage, best first;
                                         ///< @see nearestEquivalents
  std::vector<TraceEntry> trace;         ///< empty if it was cancelled
  double seconds = 0;
  CostCounters work;
};

/// Finds the pose of an object in one image. Makes the schedule; a backend carries it out.
///
/// Not thread-safe.
class FieldRefiner {
 public:
  /// @param settings validated here. @throws std::invalid_argument.
  FieldRefiner(std::shared_ptr<Backend> backend, const RefinerSettings& settings);

  /// @throws std::invalid_argument for an invalid observation or prior (sizes, NaN).
  Refinement refine(const LoadedField& field, const Observation& observation, const Prior& prior,
                    const CancellationToken& cancellation = {});

  /// The same from several priors. Inversions run together in one solver: the memory must hold the
  /// samples of one step of all of them, and each result has its part of the time and work.
  /// Alignments run one after another.
  /// @throws std::invalid_argument also if the priors of inversions differ in width.
  std::vector<Refinement> refineAll(const LoadedField& field, const Observation& observation,
                                    const std::vector<Prior>& priors,
                                    const CancellationToken& cancellation = {});

  const RefinerSettings& settings() const { return settings_; }

 private:
  void carryOut(std::vector<RefinementRun>* runs);

  std::shared_ptr<Backend> backend_;
  RefinerSettings settings_;
};

}  // namespace nerf_pose_refiner
