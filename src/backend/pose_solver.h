// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/cost_counters.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

struct AlignStage;
struct Hypothesis;
struct OptimisationPlan;
struct ResamplingPlan;
struct SamplingPlan;
struct StepRange;

/// The state of a solver at one moment.
struct SolverSnapshot {
  std::vector<Hypothesis> hypotheses;  ///< best first
  double seconds = 0;                  ///< since the solver was made
  CostCounters costs;                  ///< of the backend since then
};

/// Searches for the pose of one field in one observation. Each call performs one stage of a
/// schedule on a set of hypotheses. Calls may return before their work is done; `read` waits for
/// it.
///
/// Poses are `T_O_C`, the camera (optical frame) in the object's model frame, in model units.
/// `level` is an index into the levels given to LoadedField::makeSolver. Not thread-safe.
/// A cancelled call throws Cancelled; an invalid level or plan throws std::invalid_argument.
class PoseSolver {
 public:
  virtual ~PoseSolver() = default;

  /// Replaces all hypotheses with `plan.count` new ones around each prior, the first of them the
  /// prior itself. Each prior begins a search of its own; the searches share the processor and
  /// nothing else. The limits in `plan` refer to the first prior.
  virtual void sample(const std::vector<Pose>& priors_T_O_C, const SamplingPlan& plan) = 0;

  /// Direct alignment of every live hypothesis on one level (@see AlignStage).
  virtual void align(int level, const AlignStage& stage, const CancellationToken& cancellation) = 0;

  /// Scores every live hypothesis on one common set of pixels of a level.
  virtual void score(int level, const AlignStage& stage, const CancellationToken& cancellation) = 0;

  /// First-order inversion (the paper's mode): the gradient steps of a range within the whole run.
  /// Adam's moments are zero again after `sample` and `resample`.
  virtual void optimise(int level, const OptimisationPlan& plan, const StepRange& steps,
                        const CancellationToken& cancellation) = 0;

  /// Sets the loss of every live hypothesis to the mean of `plan`'s loss over `pixels` pixels of a
  /// level. All hypotheses use the same pixels, drawn with `plan.seed`.
  virtual void evaluate(int level, const OptimisationPlan& plan, int pixels,
                        const CancellationToken& cancellation) = 0;

  /// In each search: keeps the best hypotheses, merges duplicates, draws new ones around the rest.
  virtual void resample(const ResamplingPlan& plan) = 0;

  /// Records the present state for the next `read`; does not wait.
  virtual void snapshot() = 0;

  /// Waits for all earlier calls. @return the snapshots since the last `read`, oldest first.
  virtual std::vector<SolverSnapshot> read() = 0;

  /// The present hypotheses, best first. Waits, and discards older snapshots.
  std::vector<Hypothesis> readHypotheses();
};

}  // namespace nerf_pose_refiner
