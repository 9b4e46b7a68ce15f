// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cub/block/block_reduce.cuh>
#include <cub/block/block_scan.cuh>

#include "cast_rays.cuh"
#include "cuda_error.h"
#include "math/composite_ray.h"
#include "train.h"

// Rays of a training step.

namespace nerf_pose_refiner {
namespace {

constexpr int kThreads = 256;

using BlockScan = cub::BlockScan<unsigned, kThreads>;
using BlockReduce = cub::BlockReduce<double, kThreads>;

/// Gives every thread of a block its place in a list that `counter` counts, one behind the other.
/// All threads take part.
__device__ unsigned takePlaces(unsigned count, unsigned* counter) {
  __shared__ typename BlockScan::TempStorage scratch;
  __shared__ unsigned first;
  unsigned before, all;
  BlockScan(scratch).ExclusiveSum(count, before, all);
  if (threadIdx.x == 0) first = atomicAdd(counter, all);
  __syncthreads();
  return first + before;
}

/// Draws ray `i` of the step. @return its camera's place.
__device__ int drawRay(const TrainingTask& task, int i, TrainingRay* ray) {
  const std::uint64_t seed = stepSeed(task.seed, task.step);
  const auto index = static_cast<std::uint64_t>(i);
  const int v = drawView(seed, index, task.camera_count);
  const TrainingCamera& camera = task.cameras[v];
  const DrawnPixel at = drawPixel(seed, index, camera.window);
  const float x = (static_cast<float>(at.x) - camera.cx) / camera.fx;
  const float y = (static_cast<float>(at.y) - camera.cy) / camera.fy;
  const float scale = rsqrtf(x * x + y * y + 1);
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    ray->direction[a] =
        scale * (camera.R[3 * a] * x + camera.R[3 * a + 1] * y + camera.R[3 * a + 2]);
  }
  const uchar4 pixel =
      task.pixels[camera.first + static_cast<unsigned long long>(at.y) * camera.width + at.x];
  const std::uint8_t rgba[4] = {pixel.x, pixel.y, pixel.z, pixel.w};
  ray->target = drawTarget(seed, index, rgba, task.random_background);
  return v;
}

/// A group of kRaySamples lanes per ray: draws it, counts its samples, and takes them. The first
/// threads see to the empty points, too.
__global__ void __launch_bounds__(kThreads) marchKernel(const __grid_constant__ CudaFieldView field,
                                                        const __grid_constant__ TrainingTask task,
                                                        const __grid_constant__ MarchSpace space) {
  constexpr int G = kRaySamples, kRays = kThreads / G;
  const int thread = static_cast<int>(blockIdx.x * kThreads + threadIdx.x);
  TrainingClock* clock = task.clock;
  if (thread < kEmptyPoints) {
    float p[3];
    drawEmptyPoint(task.seed, task.step, static_cast<std::uint64_t>(thread), field, p);
    task.points[thread] = make_float4(p[0], p[1], p[2], 0);
    task.point_rays[thread] = kNoRay;
  }
  if (static_cast<int>(blockIdx.x) * kRays >= clock->rays) return;  // a whole block
  const int i = thread / G, slot = laneSlot();
  const bool drawn = i < clock->rays;
  TrainingRay ray = {};
  RayLattice lattice;
  if (drawn) {
    const int v = drawRay(task, i, &ray);
    lattice = RayLattice(task.cameras[v].origin, ray.direction, space,
                         drawJitter(stepSeed(task.seed, task.step), static_cast<std::uint64_t>(i)));
  }
  // Goes along the ray from interval `next` on; take(seen) by all lanes.
  const auto march = [&](int next, bool ended, const auto& take) {
    while (!__all_sync(kWholeWarp, ended)) {
      const Lookout seen = lookAhead(space.occupancy, lattice, next, !ended);
      take(next, seen);
      next = seen.behind;
      ended = ended || seen.ends;
    }
  };
  int first_interval = 0;
  march(0, !(lattice.entry < lattice.exit), [&](int next, const Lookout& seen) {
    if (ray.count == 0) first_interval = next;
    ray.count += __popc(seen.hits);
  });
  const unsigned before = takePlaces(slot == 0 ? ray.count : 0, &clock->marched);
  ray.first = __shfl_sync(kWholeWarp, before, 0, G);
  const bool fits = ray.first + ray.count <= task.room;
  const int cast = __syncthreads_count(drawn && fits && slot == 0);
  if (threadIdx.x == 0) atomicAdd(&clock->cast, static_cast<unsigned>(cast));
  unsigned to = ray.first;
  march(first_interval, !drawn || !fits || ray.count == 0, [&](int, const Lookout& seen) {
    if (seen.hits >> slot & 1) {
      const unsigned place = to + __popc(seen.hits & ((1u << slot) - 1));
      const float t = 0.5f * (seen.begin + seen.end);
      task.points[place] = make_float4(
          lattice.origin[0] + t * ray.direction[0], lattice.origin[1] + t * ray.direction[1],
          lattice.origin[2] + t * ray.direction[2], seen.end - seen.begin);
      task.point_rays[place] = static_cast<unsigned>(i);
    }
    to += __popc(seen.hits);
  });
  if (!drawn || slot != 0) return;
  if (!fits) ray.count = kNoRay;
  task.rays[i] = ray;
}

/// Derivatives of the loss by the density's logit at an empty point: 0 if it is not pushed down.
__device__ float emptyPush(const CudaFieldView& field, const TrainingTask& task, int i) {
  if (!task.push_empty) return 0;
  const float4 point = task.points[i];
  if (!(task.values[i].w * field.step > kClearThickness)) return 0;
  const float p[3] = {point.x, point.y, point.z};
  const OccupancyView& occupancy = field.occupancy;
  int cell[3];
  OccupancyView::cellOf(p, static_cast<float>(occupancy.fine), cell);
  const std::size_t bit =
      (static_cast<std::size_t>(cell[2]) * occupancy.fine + cell[1]) * occupancy.fine + cell[0];
  if (occupancy.bits[bit >> 3] >> (bit & 7) & 1) return 0;
  // Gradients are divided by 3 channels times the rays.
  return kEmptyPush / kEmptyPoints * 3 * static_cast<float>(task.clock->cast);
}

/// A thread per ray: what it saw, its loss, and the way back to its samples' logits. The first
/// threads see to the empty points, too.
__global__ void __launch_bounds__(kThreads)
    compositeKernel(const __grid_constant__ CudaFieldView field,
                    const __grid_constant__ TrainingTask task) {
  const int i = static_cast<int>(blockIdx.x * kThreads + threadIdx.x);
  TrainingClock* clock = task.clock;
  const int work = max(clock->rays, kEmptyPoints);
  if (static_cast<int>(blockIdx.x) * kThreads >= work) return;  // a whole block
  const float push = i < kEmptyPoints ? emptyPush(field, task, i) : 0.0f;
  const bool cast = i < clock->rays && task.rays[i].count != kNoRay;
  RaySums<float> sums = {{0, 0, 0}, 0, 0};
  TrainingLoss loss = {0, {0, 0, 0}, 0};
  unsigned first = 0;
  const auto sample_at = [&](int k) {
    const float4 value = task.values[first + k];
    return SampleValue<float>{task.points[first + k].w, value.w, {value.x, value.y, value.z}};
  };
  if (cast) {
    const TrainingRay& ray = task.rays[i];
    first = ray.first;
    sums = compositeRay(static_cast<int>(ray.count), kTrainingMinTransmittance, sample_at);
    loss = trainingLoss(sums.rgb, sums.alpha, ray.target);
  }
  unsigned to = takePlaces(static_cast<unsigned>(sums.seen) + (push > 0 ? 1 : 0), &clock->learned);
  if (push > 0) {
    task.learned[to] = static_cast<unsigned>(i);
    task.gradients[to++] = make_float4(0, 0, 0, push);
  }
  carryBackRay(sums, loss.rgb, loss.alpha, sample_at, [&](int k, const float by_logits[4]) {
    task.learned[to + k] = first + k;
    task.gradients[to + k] = make_float4(by_logits[0], by_logits[1], by_logits[2], by_logits[3]);
  });
  __shared__ typename BlockReduce::TempStorage scratch;
  const double sum = BlockReduce(scratch).Sum(static_cast<double>(loss.value));
  if (threadIdx.x == 0) atomicAdd(&clock->loss, sum);
}

int blocksFor(int threads) { return (threads + kThreads - 1) / kThreads; }

}  // namespace

void marchTrainingRays(const CudaFieldView& field, const TrainingTask& task, cudaStream_t stream) {
  marchKernel<<<blocksFor(kRaySamples * task.max_rays), kThreads, 0, stream>>>(
      field, task, marchSpace(field, 1));
  NPR_CUDA_CHECK(cudaGetLastError());
}

void compositeTrainingRays(const CudaFieldView& field, const TrainingTask& task,
                           cudaStream_t stream) {
  compositeKernel<<<blocksFor(task.max_rays), kThreads, 0, stream>>>(field, task);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
