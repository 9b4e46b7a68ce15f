// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cuda_fp16.h>

#include "cuda_error.h"
#include "train.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 256;

constexpr float kMaxLossScale = 4096, kMinLossScale = 1.0f / 4096;
constexpr int kWholeSteps = 1000;  // until a larger loss scale is tried

__device__ std::uint32_t roundedPair(float low, float high) {
  const __half2 pair = __floats2half2_rn(low, high);
  return *reinterpret_cast<const std::uint32_t*>(&pair);
}

/// A thread per four numbers. Those that no gradient has touched are neither read nor written.
__global__ void __launch_bounds__(kThreads)
    adamKernel(const __grid_constant__ LearnedNumbers numbers, const TrainingClock* clock,
               float learning_rate) {
  const unsigned i = blockIdx.x * kThreads + threadIdx.x;
  if (i >= numbers.quads) return;
  const float4 raw = numbers.gradient[i];
  if (raw.x == 0 && raw.y == 0 && raw.z == 0 && raw.w == 0) return;
  numbers.gradient[i] = make_float4(0, 0, 0, 0);
  if (clock->broken) return;
  const float fraction = 1 / (3 * clock->loss_scale * static_cast<float>(max(clock->cast, 1u)));
  const float g[4] = {fraction * raw.x, fraction * raw.y, fraction * raw.z, fraction * raw.w};
  float4 value = numbers.values[i], first = numbers.first_moment[i],
         second = numbers.second_moment[i];
  const auto update = [&](float gradient, float* v, float* m, float* s) {
    if (gradient != 0) trainingAdam(gradient, learning_rate, v, m, s);
  };
  update(g[0], &value.x, &first.x, &second.x);
  update(g[1], &value.y, &first.y, &second.y);
  update(g[2], &value.z, &first.z, &second.z);
  update(g[3], &value.w, &first.w, &second.w);
  numbers.values[i] = value;
  numbers.first_moment[i] = first;
  numbers.second_moment[i] = second;
  if (numbers.halves == nullptr) return;
  numbers.halves[i] = make_uint2(roundedPair(value.x, value.y), roundedPair(value.z, value.w));
}

/// A thread per lane of a tile.
__global__ void packKernel(const __grid_constant__ NetworkLayers layers, const float* weights,
                           WeightPair* tiles) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  const int forward = layers.shape.forwardTiles();
  if (i >= 32 * (forward + layers.shape.backwardTiles())) return;
  const int tile = i / 32, lane = i % 32;
  tiles[i] = tile < forward ? forwardPair(layers, weights, tile, lane)
                            : transposedPair(layers, weights, tile - forward, lane);
}

/// One thread.
__global__ void finishKernel(const __grid_constant__ TrainingTask task) {
  TrainingClock* clock = task.clock;
  const unsigned cast = max(clock->cast, 1u), marched = min(clock->marched, task.room);
  clock->mean_losses += clock->loss / (3.0 * cast);
  clock->all_rays += clock->cast;
  clock->all_marched += marched;
  clock->all_learned += clock->learned;
  ++clock->steps;
  if (clock->broken) {
    ++clock->broken_steps;
    clock->loss_scale = fmaxf(0.5f * clock->loss_scale, kMinLossScale);
    clock->whole_steps = 0;
  } else if (++clock->whole_steps == kWholeSteps) {
    clock->loss_scale = fminf(2 * clock->loss_scale, kMaxLossScale);
    clock->whole_steps = 0;
  }
  // Rays that see much more than they learn from must fit, too.
  const double learned = clock->learned, taken = clock->marched - kEmptyPoints;
  const double crowd = taken / (0.8 * (task.room - kEmptyPoints)) * task.samples_per_step;
  const double fraction = static_cast<double>(cast) / clock->rays;  // of the rays that fitted
  clock->rays =
      nextRays(clock->rays, fmax(learned / fraction, crowd), task.samples_per_step, task.max_rays);
  clock->marched = kEmptyPoints;
  clock->learned = clock->cast = 0;
  clock->loss = 0;
  clock->broken = 0;
}

void updateNumbers(const LearnedNumbers& numbers, const TrainingTask& task, cudaStream_t stream) {
  const unsigned blocks = (numbers.quads + kThreads - 1) / kThreads;
  adamKernel<<<blocks, kThreads, 0, stream>>>(numbers, task.clock, task.learning_rate);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace

void updateParameters(const TrainingTask& task, cudaStream_t stream) {
  updateNumbers(task.table, task, stream);
  updateNumbers(task.weights, task, stream);
  const CudaNetworkShape& shape = task.layers.shape;
  const int lanes = 32 * (shape.forwardTiles() + shape.backwardTiles());
  packKernel<<<(lanes + kThreads - 1) / kThreads, kThreads, 0, stream>>>(
      task.layers, reinterpret_cast<const float*>(task.weights.values), task.tiles);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void finishTrainingStep(const TrainingTask& task, cudaStream_t stream) {
  finishKernel<<<1, 1, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
