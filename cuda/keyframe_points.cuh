// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <climits>

#include <cooperative_groups.h>

#include "keyframe_align.h"
#include "math/relighting.h"

namespace nerf_pose_refiner {

// What is done with the points of a keyframe at one level, by all threads of a crew: blocks that
// align one start together. Steps that need what others wrote stand behind a sync().

constexpr int kAlignThreads = 512;
constexpr int kAlignWarps = kAlignThreads / 32;
constexpr unsigned kAllLanes = 0xffffffffu;

/// The blocks that align a start together.
struct Crew {
  int rank, blocks;

  /// Waits for all threads of the crew, and sees what they wrote.
  __device__ void sync() const {
#if __CUDA_ARCH__ >= 900
    if (blocks > 1) {
      cooperative_groups::this_cluster().sync();
      return;
    }
#endif
    __syncthreads();
  }
  __device__ int thread() const { return rank * kAlignThreads + static_cast<int>(threadIdx.x); }
  __device__ int threads() const { return blocks * kAlignThreads; }
  /// Dealt out block by block, so that few pieces of work keep all blocks busy.
  __device__ int warp() const { return static_cast<int>(threadIdx.x) / 32 * blocks + rank; }
};

__device__ inline int laneIndex() { return static_cast<int>(threadIdx.x) % 32; }
__device__ inline int warpIndex() { return static_cast<int>(threadIdx.x) / 32; }

/// A level of a start's keyframe, the frame's level that it is compared with, and the start's own
/// part of the scratch memory.
struct LevelScene {
  CudaKeyframeLevel level;
  CudaFrameLevel image;
  float4* rows;
  unsigned* seen_cells;
  OcclusionTest* tests;
  int* nearest;
  SeenPoint* points;
  LightEstimate light;  ///< from the keyframe to the frame

  __device__ float4* rowPlane(int plane) const { return rows + plane * level.width * level.height; }
};

/// Where the image shows a point.
struct PointInImage {
  Vec3<float> q;  ///< in C
  bool inside;    ///< whether all four pixels around it are in the image
  int offset;     ///< of the upper left one; moved into the image if it is outside
  float u, v;     ///< 0..1, between the pixels
};

/// A coordinate as a whole number in 0..last and what is left of it, 0..1. What is not a number
/// goes to 0.
__device__ inline int splitCoordinate(float x, int last, float* rest) {
  x = x > 0 ? x : 0.0f;
  x = x < static_cast<float>(last + 1) ? x : static_cast<float>(last + 1);
  const int whole = min(static_cast<int>(x), last);
  *rest = x - static_cast<float>(whole);
  return whole;
}

__device__ inline PointInImage projectPoint(const CudaFrameLevel& image,
                                            const PointTransform<float>& pose,
                                            const Vec3<float>& p) {
  constexpr float kMinDepth = 1e-6f;
  PointInImage point;
  point.q = inCamera(pose, p);
  const bool before = point.q.z > kMinDepth;
  if (!before) point.q.z = kMinDepth;
  const float inverse_depth = 1 / point.q.z;
  const float x = image.K.fx * point.q.x * inverse_depth + image.K.cx;
  const float y = image.K.fy * point.q.y * inverse_depth + image.K.cy;
  point.inside = before && x >= 0 && x <= static_cast<float>(image.width - 1) && y >= 0 &&
                 y <= static_cast<float>(image.height - 1);
  const int column = splitCoordinate(x, image.width - 2, &point.u);
  const int row = splitCoordinate(y, image.height - 2, &point.v);
  point.offset = row * image.row_pixels + column;
  return point;
}

/// Red, green, blue and weight of the image at a point.
__device__ inline void interpolateAt(const CudaFrameLevel& image, const PointInImage& point,
                                     InterpolatedPixel<float> channels[4]) {
  const float4* upper = image.pixels + point.offset;
  const float4* lower = upper + image.row_pixels;
  const float4 a = __ldg(upper), b = __ldg(upper + 1), c = __ldg(lower), d = __ldg(lower + 1);
  channels[0] = interpolate(PixelQuad<float, float>{a.x, b.x, c.x, d.x, point.u, point.v});
  channels[1] = interpolate(PixelQuad<float, float>{a.y, b.y, c.y, d.y, point.u, point.v});
  channels[2] = interpolate(PixelQuad<float, float>{a.z, b.z, c.z, d.z, point.u, point.v});
  channels[3] = interpolate(PixelQuad<float, float>{a.w, b.w, c.w, d.w, point.u, point.v});
}

/// Finds the shown cells that nothing of the object hides from a pose. Ends with a sync().
__device__ inline void findSeenCells(const Crew& crew, const LevelScene& scene,
                                     const PointTransform<float>& pose) {
  const CudaKeyframeLevel& level = scene.level;
  const OcclusionGrid grid = occlusionGrid(scene.image.width, scene.image.height, level.spacing);
  for (int i = crew.thread(); i < level.shown_count; i += crew.threads()) {
    const Vec3<float> q = inCamera(pose, level.shown[i]);
    const OcclusionTest test = {occlusionCell(grid, scene.image.K, q), q.z};
    scene.tests[i] = test;
    if (test.cell >= 0) scene.nearest[test.cell] = INT_MAX;
  }
  crew.sync();
  for (int i = crew.thread(); i < level.shown_count; i += crew.threads()) {
    const OcclusionTest test = scene.tests[i];
    // Depths are positive: as integers they have the same order.
    if (test.cell >= 0) atomicMin(&scene.nearest[test.cell], __float_as_int(test.depth));
  }
  crew.sync();
  const float margin = occlusionMargin(scene.image.K);
  const int runs = level.height * runsOf(level.width), lane = laneIndex();
  for (int r = crew.warp(); r < runs; r += kAlignWarps * crew.blocks) {
    const ShownRun run = level.runs[r];
    bool seen = run.cells >> lane & 1;
    if (seen) {
      const OcclusionTest test = scene.tests[run.first + __popc(run.cells & ((1u << lane) - 1))];
      seen = test.cell < 0 || !(test.depth > margin * __int_as_float(scene.nearest[test.cell]));
    }
    const unsigned cells = __ballot_sync(kAllLanes, seen);
    if (lane == 0) scene.seen_cells[r] = cells;
  }
  crew.sync();
}

/// What is summed of a cell, @see kRowPlanes: colours, their squares and their weight.
template <int kPlanes>
struct CellSums {
  float4 planes[kPlanes];

  __device__ void set(int plane, const float colour[3], float weight) {
    const float r = weight * colour[0], g = weight * colour[1], b = weight * colour[2];
    planes[plane] = make_float4(r, g, b, r * colour[0]);
    planes[plane + 1] = make_float4(g * colour[1], b * colour[2], weight, 0);
  }
};

/// Samples the frame where a pose puts a cell of the keyframe. Nothing here branches, so that the
/// memory's answers for several cells are waited for together.
template <int kPlanes>
__device__ inline CellSums<kPlanes> sampleCell(const LevelScene& scene,
                                               const PointTransform<float>& pose, int x, int y) {
  const CudaKeyframeLevel& level = scene.level;
  const int column = min(max(x, 0), level.width - 1);
  const int r = y * runsOf(level.width) + column / kRunCells, bit = column % kRunCells;
  const ShownRun run = level.runs[r];
  const bool seen = (scene.seen_cells[r] >> bit & 1) && x == column;
  const int last = max(level.shown_count - 1, 0);  // the list is never empty
  const int i = min(run.first + __popc(run.cells & ((1u << bit) - 1)), last);
  const PointInImage point = projectPoint(scene.image, pose, level.shown[i]);
  InterpolatedPixel<float> pixel[4];
  interpolateAt(scene.image, point, pixel);
  const float weight = seen && point.inside ? pixel[3].value : 0.0f;
  const float colour[3] = {pixel[0].value, pixel[1].value, pixel[2].value};
  CellSums<kPlanes> sums;
  sums.set(0, colour, weight);
  if (kPlanes == kRowPlanes) {
    // Where a part of the object is hidden, covered or outside of the image, the keyframe's colours
    // are normalised over the rest of it, too: otherwise what is left would differ in mean and
    // spread. And they are in the light of the frame.
    const Vec3<float> shown =
        lightGain(scene.light.change, level.shown_normal[i]) * level.shown_colour[i];
    const float rendered[3] = {shown.x, shown.y, shown.z};
    sums.set(kPlanes - 2, rendered, weight);
  }
  return sums;
}

/// Samples the frame where a pose puts the keyframe's cells, and sums along the rows of the grid.
/// @param memory of the warp, null: it has none; [kRowPlanes][row_cells].
/// @tparam kPlanes kRowPlanes, or 2: only those of the frame.
template <int kPlanes>
__device__ inline void sumRows(const Crew& crew, const LevelScene& scene,
                               const PointTransform<float>& pose, float4* memory,
                               const KeyframeCrews& crews) {
  if (memory == nullptr) return;
  constexpr int kAtOnce = 2;  // cells of a lane
  const CudaKeyframeLevel& level = scene.level;
  const int half = level.window, cells = kRunCells + 2 * half, stride = crews.row_cells;
  const int row_runs = runsOf(level.width), runs = level.height * row_runs, lane = laneIndex();
  for (int r = crew.warp(); r < runs; r += crews.row_warps * crew.blocks) {
    const int y = r / row_runs, left = r % row_runs * kRunCells;
    for (int k = lane; k < cells; k += kAtOnce * 32) {
      CellSums<kPlanes> sums[kAtOnce];
#pragma unroll
      for (int n = 0; n < kAtOnce; ++n) {
        sums[n] = sampleCell<kPlanes>(scene, pose, left - half + k + 32 * n, y);
      }
#pragma unroll
      for (int n = 0; n < kAtOnce; ++n) {
        for (int plane = 0; plane < kPlanes && k + 32 * n < cells; ++plane) {
          memory[plane * stride + k + 32 * n] = sums[n].planes[plane];
        }
      }
    }
    __syncwarp();
    const int x = left + lane;
    for (int plane = 0; plane < kPlanes && x < level.width; ++plane) {
      const float4* from = memory + plane * stride + lane;
      float4 sum = make_float4(0, 0, 0, 0);
      for (int k = 0; k <= 2 * half; ++k) {
        const float4 cell = from[k];
        sum = make_float4(sum.x + cell.x, sum.y + cell.y, sum.z + cell.z, sum.w + cell.w);
      }
      scene.rowPlane(plane)[y * level.width + x] = sum;
    }
    __syncwarp();
  }
}

/// Local colours around a cell: of the frame from plane 0, of the keyframe from plane 2.
__device__ inline LocalColours<float> localColoursAt(const LevelScene& scene, int cell, int plane) {
  const CudaKeyframeLevel& level = scene.level;
  const int x = cell % level.width, y = cell / level.width;
  const float4* first = scene.rowPlane(plane) + x;
  const float4* second = scene.rowPlane(plane + 1) + x;
  float sums[kLocalWeight + 1] = {};
  const int last = min(y + level.window, level.height - 1);
#pragma unroll 4
  for (int v = max(y - level.window, 0); v <= last; ++v) {
    const float4 a = first[v * level.width], b = second[v * level.width];
    sums[0] += a.x;
    sums[1] += a.y;
    sums[2] += a.z;
    sums[3] += a.w;
    sums[4] += b.x;
    sums[5] += b.y;
    sums[kLocalWeight] += b.z;
  }
  return weightedLocalColours(sums);
}

/// A chosen point as the level begins, seen from a pose.
__device__ inline SeenPoint seenPoint(const LevelScene& scene, const PointTransform<float>& pose,
                                      int i) {
  const CudaKeyframeLevel& level = scene.level;
  const ChosenPlace place = level.places[i];
  const ChosenColours& chosen = level.colours[i];
  SeenPoint point;
  point.local = localColoursAt(scene, place.cell, 0);
  const LocalColours<float> seen = localColoursAt(scene, place.cell, 2);
  const int r =
      place.cell / level.width * runsOf(level.width) + place.cell % level.width / kRunCells;
  const unsigned hidden = level.runs[r].cells & ~scene.seen_cells[r];
  point.weight = hidden >> (place.cell % level.width % kRunCells) & 1 ? 0.0f : chosen.weight;
  const ProjectionJacobian<float> projection =
      projectionJacobian(scene.image.K, inCamera(pose, place.p));
  const Vec3<float> tangent[2] = {transposedTimes(pose.R, chosen.tangent[0]),
                                  transposedTimes(pose.R, chosen.tangent[1])};
  const float gain = lightGain(scene.light.change, surfaceNormal(chosen.tangent));
  for (int c = 0; c < 3; ++c) {
    const Pixel<float> gradient = carriedGradient(projection, tangent, chosen.gradient[c]);
    const float rescaled = gain * seen.inverse_deviation[c] / chosen.local.inverse_deviation[c];
    point.rendered.value[c] = renormalised(chosen.colour[c], chosen.local, seen, gain, c);
    point.rendered.du[c] = rescaled * gradient.u;
    point.rendered.dv[c] = rescaled * gradient.v;
  }
  return point;
}

}  // namespace nerf_pose_refiner
