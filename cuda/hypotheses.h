// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "math/descent_update.h"
#include "math/pose_spread.h"

namespace nerf_pose_refiner {

/// What parallel inversion carries from step to step for one hypothesis; all zero in one that was
/// just seeded. @see DescentState
struct CudaDescentState {
  int started, gathered;
  Vec3<double> force, torque;
  DescentMotion motion;
};

/// A hypothesis in the memory of the device. @see Hypothesis
struct CudaHypothesis {
  CameraPose<double> pose;  ///< T_O_C
  HypothesisState state;
  int iterations;
  int search;  ///< place of the prior that it comes from
  double loss, visible_fraction, score, residual_variance;
  double information[21];       ///< lower triangle, row by row
  double gradient_scatter[21];  ///< the same
  CudaDescentState descent;
};

/// Hypotheses of a batch on the device, search after search; there are never more than `capacity`.
struct CudaHypotheses {
  CudaHypothesis* items;
  CudaHypothesis* scratch;  ///< [capacity]
  int* order;               ///< [capacity], scratch
  int* count;               ///< how many there are
  int capacity;
};

/// Of every search. @see SamplingPlan
struct CudaSamplingPlan {
  PoseSpread spread;
  int count;
  std::uint64_t seed;
};
/// `count` hypotheses a search: the first is the prior, the others are drawn around it.
/// @param priors on the device, of `searches`.
void sampleHypotheses(const CudaHypotheses& batch, const CameraPose<double>* priors, int searches,
                      const CudaSamplingPlan& plan, cudaStream_t stream);

/// Of every search. @see ResamplingPlan
struct CudaResamplingPlan {
  int keep, offspring;
  bool redraw;
  double merge_rotation_rad, merge_translation;
  PoseSpread jitter;
  std::uint64_t seed;
};
void resampleHypotheses(const CudaHypotheses& batch, const CudaResamplingPlan& plan,
                        cudaStream_t stream);

}  // namespace nerf_pose_refiner
