// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "math/keyframe_search.h"

namespace nerf_pose_refiner {

/// Most levels of a keyframe, and of a frame.
constexpr int kMaxKeyframeLevels = 8, kMaxFrameLevels = 16;

/// A level of the frame, @see ImagePyramidTask.
struct CudaFrameLevel {
  const float4* pixels;  ///< [height][width]: RGB and weight, in rows of row_pixels
  int width, height;     ///< >= 2
  int row_pixels;        ///< from the start of one row to the start of the next
  Pinhole<float> K;
};

/// A chosen point: where it is, relative to the object's centre.
struct alignas(16) ChosenPlace {
  Vec3<float> p;
  int cell;
};

/// What the keyframe shows at a chosen point, @see KeyframeLevel.
struct ChosenColours {
  float weight;
  float colour[3];
  LocalColours<float> local;
  Vec3<float> tangent[2];
  Pixel<float> gradient[3];
};

/// A place on the outline, @see OutlinePoint. What fills groups has no normal, and is never seen.
struct CudaOutlinePoint {
  Vec3<float> p, normal;
  OutlineLook<float> look;
};

/// Cells of a run: 32 neighbours in a row of the grid.
constexpr int kRunCells = 32;

/// The shown cells of a run.
struct ShownRun {
  unsigned cells;  ///< a bit each
  int first;       ///< place of the first among the shown points
};

inline __host__ __device__ int runsOf(int width) { return (width + kRunCells - 1) / kRunCells; }

/// A shown point that tells the light, and its cell.
struct CudaLightSample {
  int shown, cell;
};

/// A level of a keyframe, @see KeyframeLevel.
struct CudaKeyframeLevel {
  int spacing, width, height, window;
  int shown_count, chosen_count, outline_count, tile_count;
  int light_count;     ///< <= kMaxLightSamples
  int point_count;     ///< of chosen points and of the outline, without what fills groups
  int outline_points;  ///< of it, likewise
  float outline_weight, outline_evidence;
  const ShownRun* runs;      ///< [height][runsOf(width)]
  const Vec3<float>* shown;  ///< [shown_count], by cells
  const Vec3<float>* shown_colour;
  const Vec3<float>* shown_normal;
  const CudaLightSample* light;  ///< [light_count]
  const ChosenPlace* places;     ///< [chosen_count]: whole groups, sorted by tiles
  const ChosenColours* colours;
  const CudaOutlinePoint* outline;  ///< [outline_count]: whole groups, sorted by tiles
  /// [tile_count + 1]: where each tile begins, first of chosen points, then of the outline, whose
  /// points begin with a new chunk.
  const int* tiles;
};

/// A pose to start from.
struct CudaKeyframeStart {
  const CudaKeyframeLevel* levels;
  Vec3<double> centre;
  double diameter;
  CameraPose<double> pose;
  int coarsest_level;
  int frame_level;  ///< of the frame's levels at hand, that the finest level is compared with
};

/// Numbers that are summed over tiles.
constexpr int kTileSums = 31;

/// What its alignment found; plain, for it stands in shared memory.
struct CudaAlignedKeyframe {
  CameraPose<double> pose;
  PointSums<double> sums;
  /// @see TileScatter: gradients, information, squared information; TileEvidence: judged, seen,
  /// tone.
  double tiles[kTileSums];
  double loss, most_weight;
  EvidenceOfKind surface, outline;
  std::int64_t evaluations;
};

/// A chosen point as alignment at a level sees it.
struct alignas(16) SeenPoint {
  float weight;
  LocalColours<float> local;      ///< around it in the frame
  RenderedPoint<float> rendered;  ///< normalised by what is seen
};

/// A shown point, tested for others before it.
struct OcclusionTest {
  int cell;  ///< of the grid of the nearest depths, -1: none
  float depth;
};

/// Numbers of a row's cell: of the frame, and of the keyframe where it is seen; two planes each.
constexpr int kRowPlanes = 4;

/// Sums of points: PointSums and how many are not hidden.
constexpr int kKeyframeSums = 32;
/// Points whose sums a warp takes at once.
constexpr int kChunkPoints = 32;

inline __host__ __device__ int chunksOf(int points) {
  return (points + kChunkPoints - 1) / kChunkPoints;
}

/// Memory that the alignment of a start needs: so much for the largest level of all.
struct KeyframeSpace {
  int cells, runs, shown, chosen, chunks, depth_cells;
  int window;  ///< largest half width of the neighbourhood of local colours [cells]
};

/// It, for as many starts as are aligned at once.
struct KeyframeScratch {
  KeyframeSpace space;
  float4* rows;          ///< [starts][4][cells]
  unsigned* seen_cells;  ///< [starts][runs]: those shown cells that nothing of the object hides
  OcclusionTest* tests;  ///< [starts][shown]
  int* nearest;          ///< [starts][depth_cells]: depths as integers
  SeenPoint* points;     ///< [starts][chosen]
  float* chunk_sums;     ///< [starts][2][chunks][kKeyframeSums]
  float* group_sums;     ///< [starts][2][chunks * groups][kKeyframeSums]
};

/// Starts to be aligned with a frame.
struct KeyframeAlignmentTask {
  const CudaKeyframeStart* starts;  ///< [count]
  CudaAlignedKeyframe* found;       ///< [count]
  int count;
  int finest_level;
  int frame_levels;
  CudaFrameLevel frame[kMaxFrameLevels];
  KeyframeLevelRules rules[kMaxKeyframeLevels];
  KeyframeScratch scratch;
};

/// How a device's blocks share the starts.
struct KeyframeCrews {
  int blocks;     ///< that align a start together: a cluster; 1 in code for devices without
  int crews;      ///< at once
  int row_warps;  ///< of a block, that have memory for a row's run
  int row_cells;  ///< that they have memory for
};

/// What of a device limits them.
struct KeyframeDevice {
  int processors;
  int most_blocks;   ///< of a crew
  int shared_bytes;  ///< of a block, for rows
};

/// Of the current device.
KeyframeDevice keyframeDevice();

/// The best for a number of starts. The result does not depend on it.
/// @param window largest half width of the neighbourhood of local colours [cells].
/// @throws std::runtime_error for a window that is too large for this device.
KeyframeCrews keyframeCrews(const KeyframeDevice& device, int starts, int window);

/// Enqueues it.
void alignKeyframes(const KeyframeAlignmentTask& task, const KeyframeCrews& crews,
                    cudaStream_t stream);

}  // namespace nerf_pose_refiner
