// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "cuda_error.h"
#include "hypotheses.h"
#include "math/resampling_count.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 128;
constexpr int kResampleThreads = 256;

__device__ CudaHypothesis freshHypothesis(const CameraPose<double>& pose, int search) {
  CudaHypothesis h = {};
  h.pose = pose;
  h.search = search;
  h.state = HypothesisState::kLive;
  return h;
}

/// A thread per hypothesis.
__global__ void sampleKernel(CudaHypotheses batch, const CameraPose<double>* priors, int searches,
                             PoseSpread spread, int count, std::uint64_t seed) {
  const int place = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (place == 0) *batch.count = searches * count;
  if (place >= searches * count) return;
  const int search = place / count, i = place % count;
  const CameraPose<double> prior = priors[search];
  batch.items[place] =
      freshHypothesis(i == 0 ? prior : drawnAround(prior, spread, seed, i), search);
}

__device__ bool isLive(const CudaHypothesis& h) { return h.state == HypothesisState::kLive; }

/// Equal ones stay in their order.
__device__ bool isBefore(const CudaHypothesis& a, int i, const CudaHypothesis& b, int j) {
  if (isBetter(a.state, a.loss, b.state, b.loss)) return true;
  return i < j && !isBetter(b.state, b.loss, a.state, a.loss);
}

/// The next hypotheses of the search in items[first..last), by all threads of a block: written to
/// scratch from `to` on, as many as fit. @return how many there are.
__device__ int resampleSearch(const CudaHypotheses& batch, const CudaResamplingPlan& plan,
                              int first, int last, int to) {
  __shared__ int flagged, survivors;
  const int thread = static_cast<int>(threadIdx.x);
  const CudaHypothesis* items = batch.items + first;
  CudaHypothesis* next = batch.scratch + to;
  const int n = last - first;
  if (thread == 0) flagged = survivors = 0;
  __syncthreads();
  for (int i = thread; i < n; i += kResampleThreads) {
    int rank = 0;
    for (int j = 0; j < n; ++j) rank += isBefore(items[j], j, items[i], i);
    batch.order[rank] = i;
    if (!isLive(items[i])) atomicAdd(&flagged, 1);
  }
  __syncthreads();

  // Best first; duplicates of better ones are left out.
  for (int r = 0; r < n && survivors < plan.keep; ++r) {
    const CudaHypothesis& h = items[batch.order[r]];
    if (!isLive(h)) break;
    bool same = false;
    for (int k = thread; k < survivors; k += kResampleThreads) {
      same = same || isDuplicate(next[k].pose, h.pose, plan.jitter.object_centre,
                                 plan.merge_rotation_rad, plan.merge_translation);
    }
    const int any = __syncthreads_or(same);
    if (thread == 0 && !any) {
      next[survivors] = h;
      next[survivors].descent = CudaDescentState{};
      ++survivors;
    }
    __syncthreads();
  }

  const int kept = survivors;
  const int wanted = resampledCount(plan.keep, plan.offspring, kept, plan.redraw ? flagged : 0);
  const int total = min(wanted, batch.capacity - to);
  for (int i = kept + thread; i < total; i += kResampleThreads) {
    CudaHypothesis child = freshHypothesis(
        drawnAround(next[i % kept].pose, plan.jitter, plan.seed, i), items[0].search);
    child.loss = HUGE_VAL;  // not known yet: no better than any that was looked at
    next[i] = child;
  }
  __syncthreads();
  return total;
}

/// One block.
__global__ void resampleKernel(CudaHypotheses batch, CudaResamplingPlan plan) {
  const int n = *batch.count;
  int total = 0;
  for (int first = 0, last; first < n; first = last) {
    for (last = first + 1; last < n && batch.items[last].search == batch.items[first].search;) {
      ++last;
    }
    total += resampleSearch(batch, plan, first, last, total);
  }
  for (int i = threadIdx.x; i < total; i += kResampleThreads) batch.items[i] = batch.scratch[i];
  if (threadIdx.x == 0) *batch.count = total;
}

}  // namespace

void sampleHypotheses(const CudaHypotheses& batch, const CameraPose<double>* priors, int searches,
                      const PoseSpread& spread, int count, std::uint64_t seed,
                      cudaStream_t stream) {
  const int blocks = (searches * count + kThreads - 1) / kThreads;
  sampleKernel<<<blocks, kThreads, 0, stream>>>(batch, priors, searches, spread, count, seed);
  NPR_CUDA_CHECK(cudaGetLastError());
}

void resampleHypotheses(const CudaHypotheses& batch, const CudaResamplingPlan& plan,
                        cudaStream_t stream) {
  resampleKernel<<<1, kResampleThreads, 0, stream>>>(batch, plan);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
