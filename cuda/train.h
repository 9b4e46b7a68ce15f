// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "field_view.h"
#include "math/training.h"
#include "nerf_pose_refiner/image.h"
#include "network_layers.h"

namespace nerf_pose_refiner {

// A step of training: rays are drawn and marched along, all samples are evaluated, rays are
// composited, and the samples that were seen go back to weights and table. Every list grows by one
// atomic sum a block, behind a scan over the block.

/// A camera of a photo that is learned from.
struct TrainingCamera {
  float fx, fy, cx, cy;
  float R[9];       ///< T_O_C, row-major
  float origin[3];  ///< of its rays, in N
  PixelWindow window;
  int width;                 ///< of the photo [px]
  unsigned long long first;  ///< of its pixels among those of all photos
};

/// A ray of a step.
struct TrainingRay {
  float direction[3];
  unsigned first;  ///< of its samples
  unsigned count;  ///< of them; 0: it meets nothing, or did not fit
  TrainingTarget target;
};

/// What steps hand on to each other, on the device.
struct TrainingClock {
  int rays;          ///< of this step
  unsigned marched;  ///< samples that were taken so far, the empty points in front included
  unsigned learned;  ///< samples that were seen, and empty points that are pushed
  unsigned cast;     ///< rays that fitted
  double loss;       ///< sum over the step's rays
  int broken;        ///< a gradient of this step is not finite: it is left out

  float loss_scale;  ///< by which gradients are multiplied, so that halves hold them
  int whole_steps;   ///< since the scale was changed last

  // Sums since the host took them last.
  double mean_losses;
  unsigned long long all_rays, all_marched, all_learned;
  unsigned steps, broken_steps;
};

/// An array of numbers that are learned, a multiple of 4, and the optimiser's memory of them.
struct LearnedNumbers {
  float4 *values, *gradient, *first_moment, *second_moment;
  uint2* halves;  ///< the values rounded, or null
  unsigned quads;
};

/// The occupancy grid in training. @see TrainingOccupancy
struct OccupancyTask {
  std::uint64_t seed;
  int step;
  int cells;                    ///< along the cube
  const std::uint32_t* region;  ///< cells that are evaluated
  int region_count;
  float* density;            ///< [region_count]: highest of late, fading
  float* seen;               ///< [region_count / kOccupancyFraction + 1], workspace
  std::uint32_t* bits;       ///< [cells^3 / 32]
  std::uint8_t* distance;    ///< [coarse^3]
  std::uint8_t* distance_2;  ///< [coarse^3], workspace
  int coarse;
};

/// A step, and the memory of all steps.
struct TrainingTask {
  std::uint64_t seed;
  int step;  ///< counts from 0
  float learning_rate;
  bool random_background;
  bool push_empty;  ///< whether empty space is pushed down already
  int samples_per_step;

  const TrainingCamera* cameras;
  int camera_count;
  const uchar4* pixels;  ///< of all photos, straight alpha

  int max_rays;
  unsigned room;  ///< for samples
  TrainingClock* clock;
  TrainingRay* rays;     ///< [max_rays]
  float4* points;        ///< [room]: position in N, length of the interval
  unsigned* point_rays;  ///< [room]: of which ray; kNoRay for the empty points, which come first
  float4* values;        ///< [room]: colour, density
  unsigned* learned;     ///< [room]: places of the samples that go back
  float4* gradients;     ///< [room]: derivatives of the step's loss by their logits, unscaled

  NetworkLayers layers;
  LearnedNumbers table, weights;
  WeightPair* tiles;  ///< of the weights, [forward, transposed][32]
};

constexpr unsigned kNoRay = 0xffffffffu;

/// Draws rays and takes their samples; then, behind evaluateTrainingSamples, composites them.
void marchTrainingRays(const CudaFieldView& field, const TrainingTask& task, cudaStream_t stream);
void compositeTrainingRays(const CudaFieldView& field, const TrainingTask& task,
                           cudaStream_t stream);

/// Colour and density of the step's samples.
void evaluateTrainingSamples(const CudaFieldView& field, const TrainingTask& task,
                             cudaStream_t stream);
/// Gradients of weights and table from the samples that were seen.
void learnFromSamples(const CudaFieldView& field, const TrainingTask& task, cudaStream_t stream);

/// Adam, for table and weights; then the weights' tiles again.
void updateParameters(const TrainingTask& task, cudaStream_t stream);
/// Ends a step: decides on the next one's rays and loss scale.
void finishTrainingStep(const TrainingTask& task, cudaStream_t stream);

/// Evaluates a fraction of the region's cells and decides again which are occupied.
void updateOccupancy(const CudaFieldView& field, const OccupancyTask& task, cudaStream_t stream);

/// Cells of an occupancy grid and their densities, on the device.
struct CellDensities {
  const std::uint32_t* cells;  ///< [count]
  int count;
  int resolution;         ///< of the grid: cells along the cube
  float *highest, *mean;  ///< [count]
};

/// Evaluates the densities of cells, at kFrozenPointsPerAxis^3 points each.
void evaluateCells(const CudaFieldView& field, const CellDensities& densities, cudaStream_t stream);

}  // namespace nerf_pose_refiner
