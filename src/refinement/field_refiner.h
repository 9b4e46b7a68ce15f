// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "nerf_pose_refiner/backend.h"
#include "nerf_pose_refiner/observation.h"
#include "refinement/covariance.h"
#include "refinement/settings.h"

namespace nerf_pose_refiner {

/// Where the object is thought to be and how far off that may be.
struct Prior {
  Pose T_O_C;  ///< camera in the object's model frame, model units
  /// Half width of the search per axis; alignment goes up to twice as far.
  double rotation_rad = 0.26;
  double translation = 0.15;        ///< the same, in object diameters
  bool rotate_about_object = true;  ///< the rotation is about the object's centre, in the axes of
                                    ///< O; false: about the camera, in its own (the paper's)

  /// @throws std::invalid_argument for a pose that is not rigid or a width that makes no sense.
  void validate() const;

  /// Whether the same poses are looked for around it, wherever it is.
  bool isAsWideAs(const Prior& other) const;
};

enum class Outcome {
  kRefined,    ///< a pose was found; `score` says how well it explains the image
  kNoOverlap,  ///< the prior lies wholly outside of the image
  kDiverged,   ///< no hypothesis survived
  kCancelled,  ///< the stop token was set
};

/// One line of the trace: the state after a stage.
struct TraceEntry {
  std::string stage;
  double seconds = 0;
  CostCounters work;  ///< spent in this stage
  int live = 0;       ///< hypotheses
  double best_loss = 0;
  Pose best_T_O_C;
};

struct RefinementRun;  // refinement/schedule.h

struct Refinement {
  Outcome outcome = Outcome::kDiverged;
  Pose T_O_C;  ///< best pose, model units; of those that look alike the one nearest to the prior
  /// 0..1, higher is better: Hypothesis::score on the scale of calibratedScore or scoreOfFraction.
  double score = 0;
  double visible_fraction = 0;           ///< 0..1
  std::optional<double> mask_agreement;  ///< @see maskAgreement; nothing: there was no mask
  Matrix6 covariance = Matrix6::Zero();  ///< of the best pose; @see poseCovariance
  HypothesisTable hypotheses;            ///< all that were followed to the last stage, best first;
                                         ///< @see nearestEquivalents
  std::vector<TraceEntry> trace;         ///< empty if it was cancelled
  double seconds = 0;
  CostCounters work;
};

/// Finds the pose of an object in one image. Makes the schedule; a backend carries it out.
///
/// Not thread-safe: one caller at a time (a backend is not shared without a lock).
class FieldRefiner {
 public:
  /// @param settings validated here. @throws std::invalid_argument.
  FieldRefiner(std::shared_ptr<Backend> backend, const RefinerSettings& settings);

  /// @throws std::invalid_argument for an observation or a prior that makes no sense (sizes, NaN).
  Refinement refine(const LoadedField& field, const Observation& observation, const Prior& prior,
                    const CancellationToken& stop = {});

  /// The same from several priors. Inversions share one solver: each has its part of the time and
  /// work, and there must be memory for as many samples a step as all of them take.
  /// Alignments look at parts of the image that their prior says, and go one after another.
  /// @throws std::invalid_argument also for priors of inversions that are not equally wide.
  std::vector<Refinement> refineAll(const LoadedField& field, const Observation& observation,
                                    const std::vector<Prior>& priors,
                                    const CancellationToken& stop = {});

  const RefinerSettings& settings() const { return settings_; }

 private:
  void carryOut(std::vector<RefinementRun>* runs);

  std::shared_ptr<Backend> backend_;
  RefinerSettings settings_;
};

}  // namespace nerf_pose_refiner
