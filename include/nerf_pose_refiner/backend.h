// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

class FieldTrainer;
class KeyframeAligner;
struct AlignStage;
struct Box;
struct Field;
struct FieldConfig;
struct Hypothesis;
struct ImageLevel;
struct Observation;
struct OptimisationPlan;
struct ResamplingPlan;
struct SamplingPlan;
struct StepRange;
struct TrainingPlan;
struct TrainingView;

/// The work that a backend has done so far; a difference is the cost of an operation.
struct CostCounters {
  std::uint64_t rays = 0;
  std::uint64_t samples = 0;         ///< evaluations of the density (hash grid and density network)
  std::uint64_t colour_samples = 0;  ///< evaluations of the colour network
  double gathers = 0;                ///< hash grid entries read, or updated with a gradient
  double flops = 0;                  ///< of interpolation and networks, forward and backward

  CostCounters& operator+=(const CostCounters& other);
};

/// The work done between two readings.
CostCounters operator-(const CostCounters& after, const CostCounters& before);

/// The work of one of `count` operations that ran together.
CostCounters operator/(const CostCounters& work, int count);

/// How an image is rendered.
struct RenderOptions {
  float near = 0;                   ///< rays begin at this distance [model units]
  float step_scale = 1;             ///< multiplies the field's sample intervals
  float min_transmittance = 1e-4f;  ///< a ray ends when its transmittance falls below this
  float min_weight = 1e-4f;         ///< samples with a smaller weight are ignored
  bool use_occupancy = true;        ///< skip the cells that the occupancy grid marks as empty
};

/// The viewpoint from which a field is rendered.
struct View {
  Camera camera;
  Pose T_O_C;  ///< [model units]
};

/// An image of a field: premultiplied sRGB-encoded RGB, alpha, and the expected point per pixel.
struct Rendering {
  Image colour;  ///< [h][w][3], premultiplied
  Image alpha;   ///< [h][w][1]
  Image point;   ///< [h][w][3], sum of weight * p_O [model units]: divide by alpha
};

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

/// A field in the memory of a backend's processor. Its users share it, one caller at a time. It may
/// outlive its backend.
class LoadedField {
 public:
  virtual ~LoadedField() = default;

  virtual const Field& field() const = 0;

  /// Returns when the image is complete. @throws std::invalid_argument for an invalid camera or
  /// pose, Cancelled.
  virtual Rendering render(const View& view, const RenderOptions& options,
                           const CancellationToken& cancellation) const = 0;

  /// A solver for at most `capacity` hypotheses. The field must outlive it.
  /// @param levels resized parts of the observation, on which the stages work.
  /// @throws std::invalid_argument for an invalid observation, level or capacity.
  virtual std::unique_ptr<PoseSolver> makeSolver(const Observation& observation,
                                                 const std::vector<ImageLevel>& levels,
                                                 int capacity) const = 0;
};

/// The processor that a backend uses.
struct BackendInfo {
  std::string name;              ///< "cpu" or "cuda"
  std::string description;       ///< for logs: processor, instruction set, threads or memory
  std::size_t memory_bytes = 0;  ///< the processor's own memory; 0: it uses the host's
  int searches_at_once = 1;      ///< number of inversions of one image that use it fully
  bool warms_up = false;         ///< the first calls allocate memory and take longer
};

/// A processor that renders fields, trains them and searches for their poses.
///
/// Backends differ in speed alone; their callers make the schedules (which calls, in which order,
/// with which numbers). An implementation is called by one thread at a time, together with all that
/// it has created. The backend of `makeBackend` may be shared between threads.
class Backend {
 public:
  virtual ~Backend() = default;

  virtual BackendInfo info() const = 0;

  /// Copies a field to the processor. @throws std::invalid_argument for a field that is incomplete
  /// or has a shape that the processor does not support.
  virtual std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) = 0;

  /// A new aligner of keyframes with images. One thread may use it, also during other calls.
  virtual std::unique_ptr<KeyframeAligner> makeKeyframeAligner() = 0;

  /// A trainer of one new field; it keeps the images.
  virtual std::unique_ptr<FieldTrainer> makeTrainer(const FieldConfig& config, const Box& box,
                                                    std::vector<TrainingView> views,
                                                    const TrainingPlan& plan) = 0;

  /// The work of all that the backend has created. Calls count once they have been waited for.
  virtual CostCounters costs() const = 0;
};

/// A backend that any number of threads may share: their calls run one after another.
/// @param processor "cpu", "cuda", or "auto": CUDA where it works, else the CPU.
/// @param threads number of threads of the CPU backend; 0: one for each core.
/// @throws std::invalid_argument for an unknown processor, std::runtime_error saying why CUDA does
/// not work here.
std::shared_ptr<Backend> makeBackend(const std::string& processor = "auto", int threads = 0);

}  // namespace nerf_pose_refiner
