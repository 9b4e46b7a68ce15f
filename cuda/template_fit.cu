// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>

#include "cuda_error.h"
#include "template_match.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 128;
constexpr int kWarps = kThreads / 32;
constexpr int kFitsPerLaunch = 1024;

static_assert((2 * fitReach(0) + 1) * (2 * fitReach(0) + 1) <= kThreads, "a thread per position");

/// One block's pose. All of its threads hold the same, and look at a position each.
class Fit {
 public:
  __device__ Fit(const FitTask& task, const CudaTemplateLevel& level, int* offsets)
      : task_(task), level_(level), offsets_(offsets) {}

  /// Takes a pose, at the best of the places at most `reach` pixels away, if it is the best so far.
  __device__ void consider(CudaTemplatePose pose, int reach) {
    place(pose);
    const int left = min(max(pose.x - reach, 0), level_.width - 1);
    const int top = min(max(pose.y - reach, 0), level_.height - 1);
    const int columns = min(2 * reach + 1, level_.width - left);
    const int rows = min(2 * reach + 1, level_.height - top);
    const int position = static_cast<int>(threadIdx.x);
    unsigned key = 0;
    if (position < columns * rows) {
      const int score = scoreAt(left + position % columns, top + position / columns);
      key =
          static_cast<unsigned>(score + 1) << 16 | static_cast<unsigned>(kMostPositions - position);
    }
    key = mostOfBlock(key);
    const int best = kMostPositions - static_cast<int>(key & 0xffff);
    pose.x = left + best % columns;
    pose.y = top + best / columns;
    pose.evidence = meanResponse(static_cast<int>(key >> 16) - 1, task_.templates.feature_count);
    if (pose.evidence > best_.evidence) best_ = pose;
  }

  __device__ const CudaTemplatePose& best() const { return best_; }

 private:
  __device__ void place(const CudaTemplatePose& pose) {
    const int count = task_.templates.feature_count;
    const CudaTemplateFeature* features =
        task_.templates.features + static_cast<std::int64_t>(pose.view) * count;
    const TemplatePlacement placement =
        TemplatePlacement::of(pose.rotation_rad, level_.focal, pose.distance);
    __syncthreads();  // the last offsets are read
    for (int e = static_cast<int>(threadIdx.x); e < count; e += kThreads) {
      offsets_[e] =
          level_.order.offsetOf(placeFeature(placement, features[e].point, features[e].normal_rad));
    }
    __syncthreads();
  }

  __device__ int scoreAt(int x, int y) const {
    const std::uint8_t* place = level_.responses + level_.order.placeOf(x, y);
    const int per_part = task_.templates.feature_count / kTemplateParts;
    int sum = 0, least = 0;
    for (int part = 0; part < kTemplateParts; ++part) {
      int of_part = 0;
#pragma unroll 8
      for (int e = part * per_part; e < (part + 1) * per_part; ++e) {
        of_part += __ldg(place + offsets_[e]);
      }
      sum += of_part;
      least = part == 0 ? of_part : min(least, of_part);
    }
    return sum - least;
  }

  __device__ static unsigned mostOfBlock(unsigned key) {
    __shared__ unsigned of_warp[kWarps];
    for (int lanes = 16; lanes > 0; lanes /= 2) {
      key = max(key, __shfl_xor_sync(0xffffffffu, key, lanes));
    }
    if (threadIdx.x % 32 == 0) of_warp[threadIdx.x / 32] = key;
    __syncthreads();
    for (int warp = 0; warp < kWarps; ++warp) key = max(key, of_warp[warp]);
    return key;
  }

  const FitTask& task_;
  const CudaTemplateLevel& level_;
  int* offsets_;  // of the features, of the pose that is considered
  CudaTemplatePose best_ = {0, 0, 0, 0, 0, 0, -1};
};

__device__ CudaTemplatePose moved(CudaTemplatePose pose, const FitTask& task,
                                  const TemplateStep& step) {
  pose.rotation_rad += step.rotation * task.rotation_step;
  pose.distance *= pow(task.distance_step, step.distance);
  return pose;
}

/// A block per pose.
__global__ void fitKernel(const __grid_constant__ FitTask task, int first) {
  extern __shared__ int offsets[];
  CudaTemplatePose& pose = task.poses[first + blockIdx.x];
  const CudaTemplatePose start = pose;
  Fit fit(task, task.levels[start.level], offsets);
  for (int i = 0; i < kTurnedAndMoved; ++i) {
    fit.consider(moved(start, task, turnedAndMoved(i)), fitReach(0));
  }
  const CudaTemplatePose turned = fit.best();
  for (int i = turned.view * kViewsBeside; i < (turned.view + 1) * kViewsBeside; ++i) {
    if (task.beside[i] < 0) break;
    CudaTemplatePose beside = turned;
    beside.view = task.beside[i];
    beside.rotation_rad += task.turns[i];
    fit.consider(beside, fitReach(1));
  }
  const CudaTemplatePose seen = fit.best();
  for (int i = 0; i < kClose; ++i) fit.consider(moved(seen, task, closeStep(i)), fitReach(2));
  __syncthreads();  // all have read where it begins
  if (threadIdx.x == 0) pose = fit.best();
}

}  // namespace

void fitTemplates(const FitTask& task, cudaStream_t stream) {
  const std::size_t shared = task.templates.feature_count * sizeof(int);
  for (int first = 0; first < task.count; first += kFitsPerLaunch) {
    const int blocks = std::min(kFitsPerLaunch, task.count - first);
    fitKernel<<<blocks, kThreads, shared, stream>>>(task, first);
  }
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
