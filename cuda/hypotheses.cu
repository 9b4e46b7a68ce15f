// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cmath>

#include "cuda_error.h"
#include "hypotheses.h"
#include "nerf_pose_refiner/maths/random.h"
#include "nerf_pose_refiner/maths/so3.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 128;
constexpr int kSelectThreads = 256;

__device__ Vec3<double> uniformInBox(const Vec3<double>& half_width, std::uint64_t seed,
                                     std::uint64_t stream, std::uint64_t counter) {
  return {half_width.x * (2.0 * randomUniform(seed, stream, counter) - 1.0),
          half_width.y * (2.0 * randomUniform(seed, stream, counter + 1) - 1.0),
          half_width.z * (2.0 * randomUniform(seed, stream, counter + 2) - 1.0)};
}

/// The index-th pose around `pose`: rotated, about the object's centre in the axes of O or about
/// the camera in its own, then moved along the axes of O.
__device__ CameraPose<double> drawnAround(const CameraPose<double>& pose, const PoseSpread& spread,
                                          std::uint64_t seed, std::uint64_t index) {
  const Mat3<double> turn = expSO3(uniformInBox(spread.rotation_rad, seed, index, 0));
  const Vec3<double> move = uniformInBox(spread.translation, seed, index, 3);
  if (!spread.about_object) return {pose.R * turn, pose.o + move};
  const Vec3<double>& c = spread.object_centre;
  return {turn * pose.R, c + turn * (pose.o - c) + move};
}

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

/// Losses that are not finite come last, in a fixed order.
__device__ double rankedLoss(const CudaHypothesis& h) { return isnan(h.loss) ? HUGE_VAL : h.loss; }

__device__ bool isBefore(const CudaHypothesis& a, int i, const CudaHypothesis& b, int j) {
  if (isLive(a) != isLive(b)) return isLive(a);
  const double loss_a = rankedLoss(a), loss_b = rankedLoss(b);
  return loss_a < loss_b || (loss_a == loss_b && i < j);
}

__device__ bool isDuplicate(const CameraPose<double>& a, const CameraPose<double>& b,
                            const CudaSelectPlan& plan) {
  const Vec3<double>& c = plan.jitter.object_centre;
  const Vec3<double> moved = transposedTimes(a.R, c - a.o) - transposedTimes(b.R, c - b.o);
  if (!(norm(moved) < plan.merge_translation)) return false;
  Mat3<double> turn;  // a.R^T b.R
  for (int k = 0; k < 3; ++k) {
    const Vec3<double> v = transposedTimes(a.R, column(b.R, k));
    turn.m[0][k] = v.x;
    turn.m[1][k] = v.y;
    turn.m[2][k] = v.z;
  }
  return norm(logSO3(turn)) < plan.merge_rotation_rad;
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
      same = same || isDuplicate(batch.scratch[k].pose, h.pose, plan);
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
