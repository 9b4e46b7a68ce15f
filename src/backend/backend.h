// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "backend/hypotheses.h"
#include "backend/plans.h"
#include "backend/training.h"
#include "field/field.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/observation.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// What an backend has spent so far; differences give the cost of an operation.
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

/// An image of a field: premultiplied sRGB-encoded RGB, alpha, and the expected point per pixel.
struct Rendering {
  Image colour;  ///< [h][w][3], premultiplied
  Image alpha;   ///< [h][w][1]
  Image point;   ///< [h][w][3], sum of weight * p_O [model units]: divide by alpha
};

/// A field in the memory of an backend's processor; shared by everybody who uses it.
class LoadedField {
 public:
  virtual ~LoadedField() = default;
  virtual const Field& field() const = 0;
};

/// An observation in the memory of an backend's processor, resampled to the levels of a plan.
class LoadedObservation {
 public:
  virtual ~LoadedObservation() = default;
};

/// Hypotheses in the memory of an backend's processor: poses, moments, losses, best so far, flags.
class HypothesisBatch {
 public:
  virtual ~HypothesisBatch() = default;
};

/// What a processor can do with fields: render, train a step, descend, align, score, select.
///
/// One backend per processor; not thread-safe: one caller at a time. All poses are `T_O_C`, the
/// camera (optical frame) in the object's model frame, in model units. The schedule (which calls,
/// in which order, with which numbers) is made in the room `refine`; an backend only carries it
/// out. Every call may only enqueue; `read` and `render` wait.
class Backend {
 public:
  virtual ~Backend() = default;

  /// For logs: processor, instruction set, threads.
  virtual std::string describe() const = 0;

  virtual std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) = 0;

  virtual Rendering render(const LoadedField& field, const Camera& camera, const Pose& T_O_C,
                           const RenderOptions& options, const CancellationToken& stop) = 0;

  /// A trainer of one field; it keeps the images. The backend must live longer.
  virtual std::unique_ptr<FieldTrainer> trainer(const FieldConfig& config, const Box& box,
                                                std::vector<TrainingView> views,
                                                const TrainingPlan& plan) = 0;

  /// Resamples an observation to the given levels (a region of the image, resized).
  virtual std::shared_ptr<const LoadedObservation> observe(
      const Observation& observation, const std::vector<ImageLevel>& levels) = 0;

  virtual std::unique_ptr<HypothesisBatch> batch(int capacity) = 0;

  /// Fills the batch with `plan.count` hypotheses around each prior, the first of which is the
  /// prior itself: as many searches, which share the processor and nothing else. The limits of
  /// `plan` are of the first prior.
  virtual void sample(HypothesisBatch* batch, const std::vector<Pose>& priors_T_O_C,
                      const SamplingPlan& plan) = 0;

  /// Direct alignment of every live hypothesis on one level (@see AlignStage).
  virtual void align(HypothesisBatch* batch, const LoadedField& field,
                     const LoadedObservation& observation, int level, const AlignStage& stage,
                     const CancellationToken& stop) = 0;

  /// Scores every live hypothesis on one common set of pixels of a level.
  virtual void score(HypothesisBatch* batch, const LoadedField& field,
                     const LoadedObservation& observation, int level, const AlignStage& stage,
                     const CancellationToken& stop) = 0;

  /// First-order inversion (the paper's mode): `steps` gradient steps, the first being step
  /// `first_step` of the whole run. Moments start anew after `scatter` and `select`.
  virtual void optimise(HypothesisBatch* batch, const LoadedField& field,
                        const LoadedObservation& observation, int level,
                        const OptimisationPlan& plan, int first_step, int steps,
                        const CancellationToken& stop) = 0;

  /// Sets the loss of every live hypothesis to its mean over `pixels` pixels of a level, the same
  /// for all, drawn from `plan.seed`: the plan's own loss, where `score` has a robust one.
  virtual void evaluate(HypothesisBatch* batch, const LoadedField& field,
                        const LoadedObservation& observation, int level,
                        const OptimisationPlan& plan, int pixels,
                        const CancellationToken& stop) = 0;

  /// In each search: keeps the best, merges duplicates, and seeds new ones around the survivors.
  virtual void resample(HypothesisBatch* batch, const ResamplingPlan& plan) = 0;

  /// Waits for all that was asked, and reads the hypotheses, best first.
  virtual HypothesisTable read(const HypothesisBatch& batch) = 0;

  virtual CostCounters work() const = 0;
};

/// The CPU backend. @param threads 0: all cores. @param instruction_set "auto", "baseline", "avx2".
/// @throws std::invalid_argument for an unknown instruction set, std::runtime_error for one that
/// this processor does not have.
std::unique_ptr<Backend> makeCpuBackend(int threads = 0,
                                        const std::string& instruction_set = "auto");

}  // namespace nerf_pose_refiner
