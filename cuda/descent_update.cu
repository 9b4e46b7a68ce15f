// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "cuda_error.h"
#include "math/ray_budget.h"
#include "optimise.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kSumThreads = 512;  // a hypothesis alone has all the rays of a step
constexpr int kRaySums = 2;       // loss, weight

/// One thread: the live hypotheses, in their order.
__global__ void startKernel(OptimisationTask task, int first_step) {
  int live = 0;
  for (int i = 0; i < *task.batch.count; ++i) {
    if (task.batch.items[i].state == HypothesisState::kLive) task.live[live++] = i;
  }
  for (int i = 0; i < live; ++i) task.scores[i] = make_double2(0, 0);
  *task.clock = DescentClock{};
  task.clock->live = live;
  task.clock->step = first_step - 1;
}

/// One block: rays for each hypothesis so that all samples together come near the plan's budget.
__global__ void beginKernel(OptimisationTask task) {
  DescentClock* clock = task.clock;
  for (int i = threadIdx.x; i < clock->live; i += kSumThreads) task.sums[i] = GradientSums{};
  if (threadIdx.x != 0) return;
  ++clock->step;
  clock->found = clock->cast = clock->kept = 0;
  clock->samples = 0;
  if (clock->live == 0) return;
  const int rays = raysWithinBudget(task.samples_per_step, clock->live, *task.samples_per_ray);
  clock->rays = min(rays, task.max_rays / clock->live);
}

__global__ void measureKernel(OptimisationTask task, int pixels) {
  task.clock->step = -1;  // a stream of random numbers that no step has
  task.clock->rays = pixels;
}

/// Sums over a hypothesis' rays, by one block and in a fixed order; the result in sums[0][].
__device__ void sumRays(const OptimisationTask& task, double (&sums)[kSumThreads][kRaySums]) {
  double own[kRaySums] = {};
  const int rays = task.clock->rays;
  const std::size_t first = static_cast<std::size_t>(blockIdx.x) * rays;
#pragma unroll 4
  for (int i = threadIdx.x; i < rays; i += kSumThreads) {
    own[0] += task.records[first + i].loss;
    own[1] += task.records[first + i].weight;
  }
  for (int k = 0; k < kRaySums; ++k) sums[threadIdx.x][k] = own[k];
  for (int half = kSumThreads / 2; half > 0; half /= 2) {
    __syncthreads();
    if (static_cast<int>(threadIdx.x) < half) {
      for (int k = 0; k < kRaySums; ++k) sums[threadIdx.x][k] += sums[threadIdx.x + half][k];
    }
  }
  __syncthreads();
}

/// One update of Adam from the gathered forces and torques. @see OptimisationPlan
__device__ void updatePose(const OptimisationTask& task, double decay, CudaHypothesis* hypothesis) {
  CudaDescentState& state = hypothesis->descent;
  DescentRates rates = task.rates;
  rates.translation *= decay;
  rates.rotation *= decay;
  const double fraction = 1.0 / state.gathered;
  const bool finite = updatePose(rates, fraction * state.force, fraction * state.torque,
                                 &state.motion, &hypothesis->pose);
  state.gathered = 0;
  state.force = state.torque = {0, 0, 0};
  ++hypothesis->iterations;
  if (!finite) hypothesis->state = HypothesisState::kNotFinite;
}

/// Tracks the samples that a ray takes on average, slowly after the first step.
__device__ void followSamples(const OptimisationTask& task) {
  const DescentClock& clock = *task.clock;
  const double rays = static_cast<double>(clock.rays) * clock.live;
  const double measured = static_cast<double>(clock.samples) / rays;
  double* tracked = task.samples_per_ray;
  *tracked = updatedSamplesPerRay(*tracked, measured);
}

__device__ Vec3<double> vectorOf(const long long (&sums)[3]) {
  return {static_cast<double>(sums[0]), static_cast<double>(sums[1]), static_cast<double>(sums[2])};
}

/// A block per live hypothesis: takes one step's means, and updates the pose if there are enough.
__global__ void __launch_bounds__(kSumThreads) updateKernel(OptimisationTask task, float side) {
  const int i = static_cast<int>(blockIdx.x);
  if (i >= task.clock->live) return;
  __shared__ double sums[kSumThreads][kRaySums];
  sumRays(task, sums);
  if (threadIdx.x != 0) return;
  if (i == 0) followSamples(task);
  const int step = task.clock->step;
  if (step >= task.scored_from) {
    task.scores[i].x += sums[0][0];
    task.scores[i].y += sums[0][1];
  }
  CudaHypothesis* hypothesis = &task.batch.items[task.live[i]];
  CudaDescentState& state = hypothesis->descent;
  if (!state.started) {
    state.started = 1;
    state.motion.start = hypothesis->pose;
  }
  const double fraction = kGradientUnit / task.clock->rays;
  const GradientSums& gradient = task.sums[i];
  state.force += (task.rates.length_unit / side * fraction) * vectorOf(gradient.force);
  state.torque += fraction * vectorOf(gradient.torque);
  if (++state.gathered < task.steps_per_update) return;
  updatePose(task, task.schedule.rateFactor(step / task.steps_per_update), hypothesis);
}

/// Infinite where no pixel has a weight: the worst there is.
__device__ double meanLoss(double loss, double weight) {
  return weight > 0 ? loss / weight : HUGE_VAL;
}

/// A thread per live hypothesis.
__global__ void finishKernel(OptimisationTask task) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= task.clock->live) return;
  task.batch.items[task.live[i]].loss = meanLoss(task.scores[i].x, task.scores[i].y);
}

/// A block per live hypothesis.
__global__ void __launch_bounds__(kSumThreads) lossKernel(OptimisationTask task) {
  const int i = static_cast<int>(blockIdx.x);
  if (i >= task.clock->live) return;
  __shared__ double sums[kSumThreads][kRaySums];
  sumRays(task, sums);
  if (threadIdx.x == 0) task.batch.items[task.live[i]].loss = meanLoss(sums[0][0], sums[0][1]);
}

}  // namespace

void startOptimisation(const OptimisationTask& task, int first_step, cudaStream_t stream) {
  startKernel<<<1, 1, 0, stream>>>(task, first_step);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void beginStep(const OptimisationTask& task, cudaStream_t stream) {
  beginKernel<<<1, kSumThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void beginMeasuring(const OptimisationTask& task, int pixels, cudaStream_t stream) {
  measureKernel<<<1, 1, 0, stream>>>(task, pixels);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void updatePoses(const OptimisationTask& task, float side, int hypotheses, cudaStream_t stream) {
  updateKernel<<<hypotheses, kSumThreads, 0, stream>>>(task, side);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void finishOptimisation(const OptimisationTask& task, int hypotheses, cudaStream_t stream) {
  finishKernel<<<(hypotheses + 127) / 128, 128, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void sumLosses(const OptimisationTask& task, int hypotheses, cudaStream_t stream) {
  lossKernel<<<hypotheses, kSumThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
