// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include "field_view.h"

namespace nerf_pose_refiner {

/// Samples of a field, apart from any ray.
struct EvaluationTask {
  int count;
  const float* positions;   ///< [count][3], in N
  const float* directions;  ///< [count][3], unit length
  float4* values;           ///< [count]: colour (sRGB-encoded), density per unit of N; may be null
  const float4* gradients;  ///< [count]: a loss' derivatives by colour and density
  float* position_gradients;  ///< [count][3]: by the position in N, or null: forward only
};

/// Enqueues the evaluation of samples, and the way back to their positions if that is asked for.
void evaluateSamples(const CudaFieldView& field, const EvaluationTask& task, cudaStream_t stream);

}  // namespace nerf_pose_refiner
