// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "render.h"

#include "backend/common/box_window.h"
#include "cast_rays.cuh"
#include "launch.cuh"
#include "ray_hits.cuh"

namespace nerf_pose_refiner {
namespace {

constexpr int kWindowThreads = 64;
constexpr int kFindThreads = 128;
constexpr int kRenderThreads = 128;
constexpr int kTileWidth = 8, kTileHeight = 4;  // pixels of a warp that looks for hits

/// A thread per view: its window.
__global__ void windowKernel(const __grid_constant__ CudaFieldView field,
                             const __grid_constant__ RenderTask task) {
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i < 2) task.hits.counts[i] = 0;
  if (i >= task.view_count) return;
  CudaView view = {};
  if (task.active == nullptr || task.active[i]) {
    const CameraPose<double> pose = task.poses[i];
    const PixelWindow window = boxWindow(task.camera, pose, field.box_O_min, field.box_O_max);
    for (int k = 0; k < 9; ++k) view.R[k] = static_cast<float>(pose.R.m[k / 3][k % 3]);
    view.o[0] = static_cast<float>(pose.o.x);
    view.o[1] = static_cast<float>(pose.o.y);
    view.o[2] = static_cast<float>(pose.o.z);
    view.x = window.x;
    view.y = window.y;
    view.width = window.width;
    view.height = window.height;
  }
  task.views[i] = view;
}

/// A ray of a pixel's lattice of rays.
struct ImageRay {
  int view, x, y;
  int index;  ///< in the lattice, row by row
};

__device__ RayLattice rayOf(const CudaFieldView& field, const RenderTask& task,
                            const MarchSpace& space, const ImageRay& ray) {
  const CudaView& view = task.views[ray.view];
  const int side = task.rays_per_side;
  const float fraction = 1.0f / static_cast<float>(side);
  const float u =
      static_cast<float>(ray.x) - 0.5f + (static_cast<float>(ray.index % side) + 0.5f) * fraction;
  const float v =
      static_cast<float>(ray.y) - 0.5f + (static_cast<float>(ray.index / side) + 0.5f) * fraction;
  const float x = (u - static_cast<float>(task.camera.cx)) / static_cast<float>(task.camera.fx);
  const float y = (v - static_cast<float>(task.camera.cy)) / static_cast<float>(task.camera.fy);
  const float scale = rsqrtf(x * x + y * y + 1);
  float origin[3], direction[3];
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    direction[a] = scale * (view.R[3 * a] * x + view.R[3 * a + 1] * y + view.R[3 * a + 2]);
    origin[a] = (view.o[a] - field.origin[a]) / field.side;
  }
  return RayLattice(origin, direction, space, 0);
}

/// A thread per pixel of the image, blockIdx.y is the view: lists the rays that hit. A
/// warp looks at a tile of kTileWidth x kTileHeight pixels. A ray's id is its place in task.rays.
__global__ void findRaysKernel(const __grid_constant__ CudaFieldView field,
                               const __grid_constant__ RenderTask task,
                               const __grid_constant__ MarchSpace space) {
  const int view_index = static_cast<int>(blockIdx.y);
  const CudaView& view = task.views[view_index];
  const int tiles_x = (view.width + kTileWidth - 1) / kTileWidth;
  const int tiles_y = (view.height + kTileHeight - 1) / kTileHeight;
  const int tile = static_cast<int>((blockIdx.x * blockDim.x + threadIdx.x) / 32);
  if (tile >= tiles_x * tiles_y) return;  // a whole warp
  const int lane = threadIdx.x % 32;
  const int in_x = tile % tiles_x * kTileWidth + lane % kTileWidth;
  const int in_y = tile / tiles_x * kTileHeight + lane / kTileWidth;
  const bool inside = in_x < view.width && in_y < view.height;
  const int x = view.x + in_x, y = view.y + in_y;
  const int rays = task.rays_per_side * task.rays_per_side;
  for (int i = 0; i < rays; ++i) {
    RayInterval interval = {0, 0, 0};
    const bool found =
        inside && findOccupiedVolume(rayOf(field, task, space, {view_index, x, y, i}),
                                     space.occupancy, &interval);
    const int pixel = (view_index * task.camera.height + y) * task.camera.width + x;
    appendHit(task.hits, found,
              {static_cast<unsigned>(pixel * rays + i), static_cast<unsigned>(interval.k)});
  }
  const unsigned pixels = __popc(__ballot_sync(kWholeWarp, inside));
  if (lane == 0) atomicAdd(&task.work->rays, static_cast<unsigned long long>(pixels * rays));
}

/// Rays that were listed; @see findSamples.
struct ImageSource {
  const CudaFieldView& field;
  const RenderTask& task;
  const MarchSpace& space;
  HitQueue queue;

  __device__ ImageSource(const CudaFieldView& the_field, const RenderTask& the_task,
                         const MarchSpace& the_space)
      : field(the_field), task(the_task), space(the_space) {}

  __device__ bool active() const { return queue.active; }
  __device__ bool exhausted() const { return queue.exhausted; }
  __device__ void start(RayGroup* ray) {
    const int rays = task.rays_per_side * task.rays_per_side;
    const int pixel = static_cast<int>(queue.hit.id) / rays;
    const int row = pixel / task.camera.width;
    const ImageRay own = {row / task.camera.height, pixel % task.camera.width,
                          row % task.camera.height, static_cast<int>(queue.hit.id) % rays};
    ray->start(rayOf(field, task, space, own), static_cast<int>(queue.hit.first));
  }

  __device__ bool turnOver(const RayGroup& ray) {
    const bool done = queue.active && ray.ended && ray.count == 0;
    if (__any_sync(kWholeWarp, done)) {
      const float3 rgb = {groupSum(ray.rgb[0]), groupSum(ray.rgb[1]), groupSum(ray.rgb[2])};
      const float alpha = groupSum(ray.alpha), depth = groupSum(ray.depth);
      if (done) write(ray, rgb, alpha, depth);
    }
    return queue.take(task.hits, &task.hits.counts[1]);
  }

  /// An image needs the sums alone.
  __device__ void keep(const RayGroup&, const SampleWeight&, bool, float, const float3&) const {}

  __device__ void write(const RayGroup& ray, float3 rgb, float alpha, float depth) {
    // The ray in model units, seen from the object's centre.
    float seen[3];
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      const float origin = ray.lattice.origin[a] * field.side +
                           (field.origin[a] - static_cast<float>(field.centre[a]));
      seen[a] = alpha * origin + depth * field.side * ray.lattice.direction[a];
    }
    float4* to = task.rays + 2 * static_cast<std::size_t>(queue.hit.id);
    if (laneSlot() == 0) to[0] = make_float4(rgb.x, rgb.y, rgb.z, alpha);
    if (laneSlot() == 1) to[1] = make_float4(seen[0], seen[1], seen[2], 1);
    queue.active = false;
  }
};

/// A thread per pixel, blockIdx.y is the view: the mean of its rays.
__global__ void poolRaysKernel(const __grid_constant__ RenderTask task) {
  const int pixels = task.camera.width * task.camera.height;
  const int i = static_cast<int>(blockIdx.x * blockDim.x + threadIdx.x);
  if (i >= pixels || (task.active != nullptr && !task.active[blockIdx.y])) return;
  const std::size_t pixel = static_cast<std::size_t>(blockIdx.y) * pixels + i;
  const int rays = task.rays_per_side * task.rays_per_side;
  const float fraction = 1.0f / static_cast<float>(rays);
  float4 colour = make_float4(0, 0, 0, 0), point = colour;
  for (int k = 0; k < rays; ++k) {
    const float4 c = task.rays[2 * (pixel * rays + k)], p = task.rays[2 * (pixel * rays + k) + 1];
    colour.x += fraction * c.x;
    colour.y += fraction * c.y;
    colour.z += fraction * c.z;
    colour.w += fraction * c.w;
    point.x += fraction * p.x;
    point.y += fraction * p.y;
    point.z += fraction * p.z;
  }
  task.images[2 * pixel] = colour;
  task.images[2 * pixel + 1] = point;
}

/// A persistent grid: warps take rays until there are none.
template <int W>
__global__ void __launch_bounds__(kRenderThreads, 4)
    renderKernel(const __grid_constant__ CudaFieldView field,
                 const __grid_constant__ RenderTask task,
                 const __grid_constant__ MarchSpace space) {
  ImageSource source(field, task, space);
  const LaneWork work = castRays<W>(field, space, task.min_transmittance, task.min_weight, &source);
  addWork(task.costs, work.samples, work.colours, task.work);
}

}  // namespace

void renderImages(const CudaFieldView& field, const RenderTask& task, cudaStream_t stream) {
  MarchSpace space = marchSpace(field, task.step_scale);
  space.near = task.near / field.side;
  if (!task.use_occupancy) space.occupancy = OccupancyView();

  const int rays = task.rays_per_side * task.rays_per_side;
  const int pixels = task.camera.width * task.camera.height;
  const std::size_t all = static_cast<std::size_t>(task.view_count) * pixels * rays;
  NPR_CUDA_CHECK(cudaMemsetAsync(task.rays, 0, all * 2 * sizeof(float4), stream));
  const int blocks = (task.view_count + kWindowThreads - 1) / kWindowThreads;
  windowKernel<<<blocks, kWindowThreads, 0, stream>>>(field, task);
  NPR_CUDA_CHECK(cudaGetLastError());
  const int tiles = ((task.camera.width + kTileWidth - 1) / kTileWidth) *
                    ((task.camera.height + kTileHeight - 1) / kTileHeight);
  constexpr int kWarps = kFindThreads / 32;
  const dim3 grid((tiles + kWarps - 1) / kWarps, task.view_count);
  findRaysKernel<<<grid, kFindThreads, 0, stream>>>(field, task, space);
  NPR_CUDA_CHECK(cudaGetLastError());
  const int bytes = SharedLayout(field.shape, kRaySamples, false).bytes(kRenderThreads / 32);
  const auto kernel = field.shape.width == 32 ? renderKernel<32> : renderKernel<64>;
  launchPersistent(kernel, kRenderThreads, bytes, stream, field, task, space);
  if (rays == 1) return;
  const dim3 pool_grid((pixels + kFindThreads - 1) / kFindThreads, task.view_count);
  poolRaysKernel<<<pool_grid, kFindThreads, 0, stream>>>(task);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
