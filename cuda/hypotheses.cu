// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "cuda_error.h"
#include "hypotheses.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 128;
constexpr int kSelectThreads = 256;

__device__ CudaHypothesis freshHypothesis(const CameraPose<double>& pose) {
  CudaHypothesis h = {};
  h.pose = pose;
  h.state = HypothesisState::kLive;
  return h;
}

/// A thread per hypothesis.
__global__ void scatterKernel(CudaHypotheses batch, CameraPose<double> prior, PoseSpread spread,
                              int count, std::uint64_t seed) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i == 0) *batch.count = count;
  if (i >= count) return;
  batch.items[i] = freshHypothesis(i == 0 ? prior : drawnAround(prior, spread, seed, i));
}

__device__ bool isLive(const CudaHypothesis& h) { return h.state == HypothesisState::kLive; }

/// Equal ones stay in their order.
__device__ bool isBefore(const CudaHypothesis& a, int i, const CudaHypothesis& b, int j) {
  if (isBetter(a.state, a.loss, b.state, b.loss)) return true;
  return i < j && !isBetter(b.state, b.loss, a.state, a.loss);
}

/// One block.
__global__ void selectKernel(CudaHypotheses batch, CudaSelectPlan plan) {
  __shared__ int flagged, survivors;
  const int n = *batch.count;
  const int thread = static_cast<int>(threadIdx.x);
  if (thread == 0) flagged = survivors = 0;
  __syncthreads();
  for (int i = thread; i < n; i += kSelectThreads) {
    int rank = 0;
    for (int j = 0; j < n; ++j) rank += isBefore(batch.items[j], j, batch.items[i], i);
    batch.order[rank] = i;
    if (!isLive(batch.items[i])) atomicAdd(&flagged, 1);
  }
  __syncthreads();

  // Best first; duplicates of better ones are left out.
  for (int r = 0; r < n && survivors < plan.keep; ++r) {
    const CudaHypothesis& h = batch.items[batch.order[r]];
    if (!isLive(h)) break;
    bool same = false;
    for (int k = thread; k < survivors; k += kSelectThreads) {
      same = same || isDuplicate(batch.scratch[k].pose, h.pose, plan.jitter.object_centre,
                                 plan.merge_rotation_rad, plan.merge_translation);
    }
    const int any = __syncthreads_or(same);
    if (thread == 0 && !any) {
      batch.scratch[survivors] = h;
      batch.scratch[survivors].descent = CudaDescentState{};
      ++survivors;
    }
    __syncthreads();
  }

  const int kept = survivors;
  const int redrawn = min(plan.keep, kept + (plan.redraw ? flagged : 0));
  const int total = kept == 0 ? 0 : min(max(kept, max(plan.offspring, redrawn)), batch.capacity);
  for (int i = kept + thread; i < total; i += kSelectThreads) {
    CudaHypothesis child =
        freshHypothesis(drawnAround(batch.scratch[i % kept].pose, plan.jitter, plan.seed, i));
    child.loss = HUGE_VAL;  // not known yet: no better than any that was looked at
    batch.scratch[i] = child;
  }
  __syncthreads();
  for (int i = thread; i < total; i += kSelectThreads) batch.items[i] = batch.scratch[i];
  if (thread == 0) *batch.count = total;
}

}  // namespace

void scatterHypotheses(const CudaHypotheses& batch, const CameraPose<double>& prior,
                       const PoseSpread& spread, int count, std::uint64_t seed,
                       cudaStream_t stream) {
  scatterKernel<<<(count + kThreads - 1) / kThreads, kThreads, 0, stream>>>(batch, prior, spread,
                                                                            count, seed);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void selectHypotheses(const CudaHypotheses& batch, const CudaSelectPlan& plan,
                      cudaStream_t stream) {
  selectKernel<<<1, kSelectThreads, 0, stream>>>(batch, plan);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
