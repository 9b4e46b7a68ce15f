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

/// What a backend has spent so far; differences give the cost of an operation.
struct CostCounters {
  std::uint64_t rays = 0;
  std::uint64_t samples = 0;         ///< evaluations of the density (hash grid and density network)
  std::uint64_t colour_samples = 0;  ///< evaluations of the colour network
  double gathers = 0;                ///< grid entries read, or changed by a gradient
  double flops = 0;                  ///< of interpolation and networks, there and back

  CostCounters& operator+=(const CostCounters& other);
};

/// What was spent between two readings.
CostCounters operator-(const CostCounters& after, const CostCounters& before);

/// The share of one of `count` that worked together.
CostCounters operator/(const CostCounters& work, int count);

/// How an image is rendered.
struct RenderOptions {
  float near = 0;                   ///< nothing nearer is seen [model units along the ray]
  float step_scale = 1;             ///< multiplies the field's sample intervals
  float min_transmittance = 1e-4f;  ///< a ray ends when less than this is left
  float min_weight = 1e-4f;         ///< lighter samples count for nothing; a tenth of an 8-bit step
  bool use_occupancy = true;        ///< skip what the occupancy grid calls empty
};

/// Where a field is seen from.
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

/// What a solver knew at one moment.
struct SolverSnapshot {
  std::vector<Hypothesis> hypotheses;  ///< best first
  double seconds = 0;                  ///< since the solver was made
  CostCounters costs;                  ///< of the backend since then
};

/// Searches for the pose of one field in one observation: carries out the stages of a schedule, one
/// call each, on a set of hypotheses. Calls may only enqueue; `read` waits.
///
/// Poses are `T_O_C`, the camera (optical frame) in the object's model frame, in model units.
/// Levels are numbered as they were given to LoadedField::makeSolver. One caller at a time.
/// A call that is cancelled throws Cancelled; one whose level or plan makes no sense throws
/// std::invalid_argument.
class PoseSolver {
 public:
  virtual ~PoseSolver() = default;

  /// Starts anew with `plan.count` hypotheses around each prior, the first of which is the prior
  /// itself: as many searches, which share the processor and nothing else. The limits of `plan`
  /// are of the first prior.
  virtual void sample(const std::vector<Pose>& priors_T_O_C, const SamplingPlan& plan) = 0;

  /// Direct alignment of every live hypothesis on one level (@see AlignStage).
  virtual void align(int level, const AlignStage& stage, const CancellationToken& cancellation) = 0;

  /// Scores every live hypothesis on one common set of pixels of a level.
  virtual void score(int level, const AlignStage& stage, const CancellationToken& cancellation) = 0;

  /// First-order inversion (the paper's mode): gradient steps, numbered within the whole run.
  /// Moments start anew after `sample` and `resample`.
  virtual void optimise(int level, const OptimisationPlan& plan, const StepRange& steps,
                        const CancellationToken& cancellation) = 0;

  /// Sets the loss of every live hypothesis to its mean over `pixels` pixels of a level, the same
  /// for all, drawn from `plan.seed`: the plan's own loss, where `score` has a robust one.
  virtual void evaluate(int level, const OptimisationPlan& plan, int pixels,
                        const CancellationToken& cancellation) = 0;

  /// In each search: keeps the best, merges duplicates, and seeds new ones around the survivors.
  virtual void resample(const ResamplingPlan& plan) = 0;

  /// Keeps what is known now for the next `read`; does not wait.
  virtual void snapshot() = 0;

  /// Waits for all that was asked. @return what was kept since the last call, in order.
  virtual std::vector<SolverSnapshot> read() = 0;

  /// The hypotheses as they are now, best first; waits, and drops older snapshots.
  std::vector<Hypothesis> readHypotheses();
};

/// A field in the memory of a backend's processor; shared by everybody who uses it, one caller at a
/// time. It keeps what it needs of its backend, which may end before.
class LoadedField {
 public:
  virtual ~LoadedField() = default;

  virtual const Field& field() const = 0;

  /// Waits. @throws std::invalid_argument for a camera or a pose that makes no sense, Cancelled.
  virtual Rendering render(const View& view, const RenderOptions& options,
                           const CancellationToken& cancellation) const = 0;

  /// A solver for at most `capacity` hypotheses. The field must live longer.
  /// @param levels parts of the observation, resized: what stages look at.
  /// @throws std::invalid_argument for an observation, level or capacity that makes no sense.
  virtual std::unique_ptr<PoseSolver> makeSolver(const Observation& observation,
                                                 const std::vector<ImageLevel>& levels,
                                                 int capacity) const = 0;
};

/// What a backend works on.
struct BackendInfo {
  std::string name;              ///< "cpu" or "cuda"
  std::string description;       ///< for logs: processor, instruction set, threads or memory
  std::size_t memory_bytes = 0;  ///< the processor's own; 0: it works in the host's
  int searches_at_once = 1;      ///< inversions of one image that keep it busy
  bool warms_up = false;         ///< first calls take longer: memory and graphs are made then
};

/// A processor that renders fields, trains them and searches for their poses.
///
/// Backends differ in speed alone. Schedules (which calls, in which order, with which numbers) are
/// made by their callers. One caller at a time, of a backend and all that it made (@see
/// SharedBackend).
class Backend {
 public:
  virtual ~Backend() = default;

  virtual BackendInfo info() const = 0;

  /// @throws std::invalid_argument for a field that is not whole, or of a shape that the processor
  /// does not take.
  virtual std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) = 0;

  /// What aligns keyframes with images; it may be used beside all else, by one thread.
  virtual std::unique_ptr<KeyframeAligner> makeKeyframeAligner() = 0;

  /// A trainer of one field; it keeps the images.
  virtual std::unique_ptr<FieldTrainer> makeTrainer(const FieldConfig& config, const Box& box,
                                                    std::vector<TrainingView> views,
                                                    const TrainingPlan& plan) = 0;

  /// Of all that the backend made; where calls only enqueue, as of the last wait.
  virtual CostCounters costs() const = 0;
};

/// A backend that any number of threads may share: they take turns, call by call.
/// @param processor "cpu", "cuda", or "auto": CUDA where it works, else the CPU.
/// @param threads of the CPU backend; 0: all cores.
/// @throws std::invalid_argument for an unknown processor, std::runtime_error saying why CUDA does
/// not work here.
std::shared_ptr<Backend> makeBackend(const std::string& processor = "auto", int threads = 0);

}  // namespace nerf_pose_refiner
