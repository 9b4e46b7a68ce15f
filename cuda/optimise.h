// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "field_view.h"
#include "hypotheses.h"
#include "math/loss.h"
#include "views.h"

namespace nerf_pose_refiner {

/// What a ray says of its hypothesis.
struct RayRecord {
  float rgb[3], alpha;  ///< derivative of the loss by what the ray saw
  float value;          ///< what it saw times that
  float loss, weight;
};

/// A sample that was seen, as its ray will have to know it when its loss is known.
struct RayPoint {
  unsigned id;  ///< of the ray
  float t, length, density;
  float weight;  ///< transmittance in front * opacity; 0 if it is too light to count
  float transmittance_behind;
  float rgb[3];
  float front[4];  ///< sums of weight * colour and of the weights, up to this sample
};

/// Sums over a hypothesis' samples of their gradients (Lin et al., eq. 2 and 3), in units of N.
/// Integers: in any order the same.
struct GradientSums {
  long long force[3], torque[3];
};
constexpr double kGradientUnit = 1.0 / (1 << 24);

/// Rays and hits of a step are numbered hypothesis after hypothesis. What steps hand on to each
/// other, on the device.
struct DescentClock {
  int step;                    ///< the one under way
  int live;                    ///< hypotheses that are still optimised
  int rays;                    ///< of each of them, in this step
  unsigned found, cast;        ///< rays that meet the occupied volume; those taken by warps
  unsigned kept;               ///< samples that were seen
  unsigned long long samples;  ///< of this step so far
};

/// A sequence of steps of parallel inversion. @see OptimisationPlan
struct OptimisationTask {
  // The plan.
  Loss loss;
  DescentRates rates;  ///< before any decay
  RateSchedule schedule;
  int steps_per_update, samples_per_step;
  bool direction_gradient;
  std::uint64_t seed;
  int scored_from;                      ///< steps from here on make the hypotheses' losses
  float min_transmittance, min_weight;  ///< of all rays, @see RenderOptions

  // What is compared.
  CudaCamera camera;
  const float4* image;  ///< [h][w]: RGB and alpha
  const float* weight;  ///< [h][w]
  bool background_known;
  float background[3];

  // Memory.
  CudaHypotheses batch;
  int* live;                ///< [capacity]: places of the hypotheses that are still optimised
  double* samples_per_ray;  ///< of the batch, as measured; < 0: not yet
  double2* scores;          ///< [capacity], of the live ones: loss and weight
  DescentClock* clock;
  RayRecord* records;  ///< [capacity of rays], hypothesis after hypothesis
  RayHit* hits;        ///< [capacity of rays]
  int max_rays;        ///< capacity for rays of all hypotheses
  RayPoint* points;    ///< [max_points], of the rays with a gradient; null: none are kept
  unsigned max_points;
  GradientSums* sums;  ///< [capacity], of the live ones
  CudaCosts costs;
  CudaWork* work;
};

/// Lists the live hypotheses and starts the clock: the next step is `first_step`.
void startOptimisation(const OptimisationTask& task, int first_step, cudaStream_t stream);

/// One step: rays are cast, their gradients added; every steps_per_update steps the poses move.
/// @param hypotheses at least as many as are live.
void optimiseOnce(const CudaFieldView& field, const OptimisationTask& task, int hypotheses,
                  cudaStream_t stream);

/// Makes the scored steps' means the losses of the live hypotheses.
void finishOptimisation(const OptimisationTask& task, int hypotheses, cudaStream_t stream);

/// Instead of steps: the loss of every live hypothesis over `pixels` pixels, the same for all.
void evaluateLosses(const CudaFieldView& field, const OptimisationTask& task, int pixels,
                    int hypotheses, cudaStream_t stream);

/// The parts of a step (descent_update.cu): a new step's rays; sums over rays and updates.
void beginStep(const OptimisationTask& task, cudaStream_t stream);
void beginMeasuring(const OptimisationTask& task, int pixels, cudaStream_t stream);
/// @param side of the cube N [model units].
void updatePoses(const OptimisationTask& task, float side, int hypotheses, cudaStream_t stream);
void sumLosses(const OptimisationTask& task, int hypotheses, cudaStream_t stream);

}  // namespace nerf_pose_refiner
