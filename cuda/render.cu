// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "render.h"

#include "cast_rays.cuh"
#include "launch.cuh"
#include "nerf_pose_refiner/maths/pixel_window.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kPlanThreads = 1024;
constexpr int kRenderThreads = 128;

/// Exclusive sums over a block of kPlanThreads. @return the sum of those before; *total of all.
__device__ unsigned exclusiveSum(unsigned value, unsigned* total) {
  __shared__ unsigned warp_sums[kPlanThreads / 32];
  const int lane = threadIdx.x % 32, warp = threadIdx.x / 32;
  unsigned sum = value;
  for (int away = 1; away < 32; away *= 2) {
    const unsigned other = __shfl_up_sync(kWholeWarp, sum, away);
    if (lane >= away) sum += other;
  }
  if (lane == 31) warp_sums[warp] = sum;
  __syncthreads();
  unsigned before = 0;
  *total = 0;
  for (int w = 0; w < kPlanThreads / 32; ++w) {
    if (w < warp) before += warp_sums[w];
    *total += warp_sums[w];
  }
  __syncthreads();
  return before + sum - value;
}

/// Windows and tiles of all views. One block.
__global__ void planTilesKernel(const __grid_constant__ CudaFieldView field,
                                const __grid_constant__ RenderTask task) {
  const Pinhole<double> K = {task.camera.fx, task.camera.fy, task.camera.cx, task.camera.cy};
  unsigned tiles_so_far = 0;
  for (int first = 0; first < task.view_count; first += kPlanThreads) {
    const int i = first + static_cast<int>(threadIdx.x);
    PixelWindow window;
    CudaView view = {};
    if (i < task.view_count && (task.active == nullptr || task.active[i])) {
      const CameraPose<double> pose = task.poses[i];
      window = boxWindow(K, task.camera.width, task.camera.height, pose, field.box_O_min,
                         field.box_O_max);
      for (int k = 0; k < 9; ++k) view.R[k] = static_cast<float>(pose.R.m[k / 3][k % 3]);
      view.o[0] = static_cast<float>(pose.o.x);
      view.o[1] = static_cast<float>(pose.o.y);
      view.o[2] = static_cast<float>(pose.o.z);
    }
    unsigned tiles = 0;
    if (!window.empty()) {
      view.x = window.x;
      view.y = window.y;
      view.width = window.width;
      view.height = window.height;
      view.tiles_x = (window.width + kTilePixels - 1) / kTilePixels;
      tiles = view.tiles_x * ((window.height + kTilePixels - 1) / kTilePixels);
    }
    unsigned total;
    view.first_tile = tiles_so_far + exclusiveSum(tiles, &total);
    if (i < task.view_count) task.views[i] = view;
    tiles_so_far += total;
  }
  if (threadIdx.x == 0) {
    task.tiles[0] = tiles_so_far;
    task.tiles[1] = 0;
  }
}

/// The view that a tile belongs to: the last that does not begin behind it and is not empty.
__device__ int viewOfTile(const RenderTask& task, unsigned tile) {
  int low = 0, high = task.view_count - 1;
  while (low < high) {
    const int middle = (low + high + 1) / 2;
    if (task.views[middle].first_tile <= tile) {
      low = middle;
    } else {
      high = middle - 1;
    }
  }
  return low;
}

/// The square of pixels that a warp is at work on, the same in all of its lanes.
struct Tile {
  int view = 0, x0 = 0, y0 = 0, x1 = 0, y1 = 0;
  int next = kTilePixels * kTilePixels;  // pixel, in Z-order
  bool exhausted = false;                // there are no more tiles
};

__device__ void takeTile(const RenderTask& task, Tile* tile) {
  unsigned index = 0;
  if (threadIdx.x % 32 == 0) index = atomicAdd(&task.tiles[1], 1u);
  index = __shfl_sync(kWholeWarp, index, 0);
  if (index >= task.tiles[0]) {
    tile->exhausted = true;
    return;
  }
  tile->view = viewOfTile(task, index);
  const CudaView& view = task.views[tile->view];
  const int i = static_cast<int>(index - view.first_tile);
  tile->x0 = view.x + i % view.tiles_x * kTilePixels;
  tile->y0 = view.y + i / view.tiles_x * kTilePixels;
  tile->x1 = view.x + view.width;
  tile->y1 = view.y + view.height;
  tile->next = 0;
}

/// The pixel that a group of lanes renders, and the sums over its rays.
struct PixelTask {
  bool active = false;
  int view = 0, x = 0, y = 0;
  int ray = 0;           // of the pixel's
  float4 colour, point;  // as they are stored
};

/// Gives the groups that have none their next pixels. @return whether this group got one.
__device__ bool takePixel(const RenderTask& task, Tile* tile, PixelTask* pixel) {
  const unsigned leaders = __ballot_sync(kWholeWarp, !pixel->active && laneSlot() == 0);
  if (leaders == 0) return false;
  if (tile->next >= kTilePixels * kTilePixels && !tile->exhausted) takeTile(task, tile);
  if (tile->exhausted) return false;
  const int first_lane = threadIdx.x % 32 - laneSlot();
  const int i = tile->next + __popc(leaders & ((1u << first_lane) - 1));
  tile->next += __popc(leaders);
  if (pixel->active || i >= kTilePixels * kTilePixels) return false;
  pixel->x = tile->x0 + ((i & 1) | (i >> 1 & 2) | (i >> 2 & 4));
  pixel->y = tile->y0 + ((i >> 1 & 1) | (i >> 2 & 2) | (i >> 3 & 4));
  if (pixel->x >= tile->x1 || pixel->y >= tile->y1) return false;
  pixel->active = true;
  pixel->view = tile->view;
  pixel->ray = 0;
  pixel->colour = make_float4(0, 0, 0, 0);
  pixel->point = make_float4(0, 0, 0, 1);
  return true;
}

__device__ void startRay(const CudaFieldView& field, const RenderTask& task,
                         const MarchSpace& space, const PixelTask& pixel, RayGroup* ray) {
  const CudaView& view = task.views[pixel.view];
  const int side = task.rays_per_side;
  const float share = 1.0f / static_cast<float>(side);
  const float u =
      static_cast<float>(pixel.x) - 0.5f + (static_cast<float>(pixel.ray % side) + 0.5f) * share;
  const float v =
      static_cast<float>(pixel.y) - 0.5f + (static_cast<float>(pixel.ray / side) + 0.5f) * share;
  const float x = (u - static_cast<float>(task.camera.cx)) / static_cast<float>(task.camera.fx);
  const float y = (v - static_cast<float>(task.camera.cy)) / static_cast<float>(task.camera.fy);
  const float scale = rsqrtf(x * x + y * y + 1);
  float origin[3], direction[3];
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    direction[a] = scale * (view.R[3 * a] * x + view.R[3 * a + 1] * y + view.R[3 * a + 2]);
    origin[a] = (view.o[a] - field.origin[a]) / field.side;
  }
  ray->start(origin, direction, space, 0);
}

/// Adds a ray that has ended to its pixel.
__device__ void addRay(const CudaFieldView& field, const RenderTask& task, const RayGroup& ray,
                       float3 rgb, float alpha, float depth, PixelTask* pixel) {
  const int rays = task.rays_per_side * task.rays_per_side;
  const float share = 1.0f / static_cast<float>(rays);
  pixel->colour.x += share * rgb.x;
  pixel->colour.y += share * rgb.y;
  pixel->colour.z += share * rgb.z;
  pixel->colour.w += share * alpha;
  // The ray in model units, seen from the object's centre.
  float* point = &pixel->point.x;
#pragma unroll
  for (int a = 0; a < 3; ++a) {
    const float origin = ray.lattice.origin[a] * field.side +
                         (field.origin[a] - static_cast<float>(field.centre[a]));
    point[a] += share * (alpha * origin + depth * field.side * ray.lattice.direction[a]);
  }
}

/// Rays of the pixels of tiles; @see findSamples.
struct TileSource {
  const CudaFieldView& field;
  const RenderTask& task;
  const MarchSpace& space;
  Tile tile;
  PixelTask pixel;
  unsigned rays = 0;

  __device__ TileSource(const CudaFieldView& the_field, const RenderTask& the_task,
                        const MarchSpace& the_space)
      : field(the_field), task(the_task), space(the_space) {}

  __device__ bool active() const { return pixel.active; }
  __device__ bool exhausted() const { return tile.exhausted; }
  __device__ void start(RayGroup* ray) {
    startRay(field, task, space, pixel, ray);
    rays += laneSlot() == 0;
  }

  __device__ bool turnOver(const RayGroup& ray) {
    bool fresh = false;
    const bool done = pixel.active && ray.ended && ray.count == 0;
    if (__any_sync(kWholeWarp, done)) {
      const float3 rgb = {groupSum(ray.rgb[0]), groupSum(ray.rgb[1]), groupSum(ray.rgb[2])};
      const float alpha = groupSum(ray.alpha), depth = groupSum(ray.depth);
      if (done) {
        addRay(field, task, ray, rgb, alpha, depth, &pixel);
        fresh = ++pixel.ray < task.rays_per_side * task.rays_per_side;
        if (!fresh) writePixel();
      }
    }
    return takePixel(task, &tile, &pixel) || fresh;
  }

  __device__ void writePixel() {
    const std::size_t row = static_cast<std::size_t>(pixel.view) * task.camera.height + pixel.y;
    float4* to = task.pictures + 2 * (row * task.camera.width + pixel.x);
    if (laneSlot() == 0) to[0] = pixel.colour;
    if (laneSlot() == 1) to[1] = pixel.point;
    pixel.active = false;
  }
};

/// A persistent grid: warps take tiles until there are none.
template <int W>
__global__ void __launch_bounds__(kRenderThreads, W == 32 ? 4 : 3)
    renderKernel(const __grid_constant__ CudaFieldView field,
                 const __grid_constant__ RenderTask task,
                 const __grid_constant__ MarchSpace space) {
  TileSource source(field, task, space);
  const LaneWork work =
      castRays<W>(field, space, task.min_transmittance, kColourThreshold, &source);
  addWork(task.costs, source.rays, work.samples, work.colours, task.work);
}

}  // namespace

void renderPictures(const CudaFieldView& field, const RenderTask& task, cudaStream_t stream) {
  MarchSpace space = marchSpace(field, task.step_scale);
  space.near = task.near / field.side;
  if (!task.use_occupancy) space.occupancy = OccupancyView();

  const std::size_t pixels =
      static_cast<std::size_t>(task.view_count) * task.camera.width * task.camera.height;
  NPR_CUDA_CHECK(cudaMemsetAsync(task.pictures, 0, pixels * 2 * sizeof(float4), stream));
  planTilesKernel<<<1, kPlanThreads, 0, stream>>>(field, task);
  NPR_CUDA_CHECK(cudaGetLastError());
  const int bytes = SharedLayout(field.shape, kRaySamples, false).bytes(kRenderThreads / 32);
  const auto kernel = field.shape.width == 32 ? renderKernel<32> : renderKernel<64>;
  launchPersistent(kernel, kRenderThreads, bytes, stream, field, task, space);
}

}  // namespace nerf_pose_refiner
