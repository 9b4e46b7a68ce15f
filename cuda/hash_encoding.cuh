// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_fp16.h>

#include <cstdint>

#include "field_view.h"

namespace nerf_pose_refiner {

/// How entries of F halves are read. Gathers are what limits a field's evaluation, and a gather of
/// 4 bytes costs as much as one of 16. Two neighbours along x are in one aligned pair of entries
/// whenever the lower one's x (hashed: its index) is even: then one gather brings both.
template <int F>
struct GridEntry;
template <>
struct GridEntry<2> {
  using Entry = std::uint32_t;
  using Pair = uint2;
  __device__ static Entry low(Pair p) { return p.x; }
  __device__ static Entry high(Pair p) { return p.y; }
  __device__ static void unpack(Entry e, float out[2]) {
    const float2 v = __half22float2(*reinterpret_cast<const __half2*>(&e));
    out[0] = v.x;
    out[1] = v.y;
  }
};
template <>
struct GridEntry<4> {
  using Entry = uint2;
  using Pair = uint4;
  __device__ static Entry low(Pair p) { return make_uint2(p.x, p.y); }
  __device__ static Entry high(Pair p) { return make_uint2(p.z, p.w); }
  __device__ static void unpack(Entry e, float out[4]) {
    GridEntry<2>::unpack(e.x, out);
    GridEntry<2>::unpack(e.y, out + 2);
  }
};
template <>
struct GridEntry<8> {
  using Entry = uint4;
  __device__ static void unpack(Entry e, float out[8]) {
    GridEntry<2>::unpack(e.x, out);
    GridEntry<2>::unpack(e.y, out + 2);
    GridEntry<2>::unpack(e.z, out + 4);
    GridEntry<2>::unpack(e.w, out + 6);
  }
};

/// The cell of a position at one level: places in the table of the pairs of corners along x, in the
/// order (y, z) = (0, 0), (1, 0), (0, 1), (1, 1).
struct GridCell {
  std::uint32_t low[4], high[4];
  float fx, fy, fz;
};

__device__ inline float splitCell(float x, float resolution, std::uint32_t* cell) {
  const float scaled = fminf(fmaxf(__fmul_rn(x, resolution), 0.0f), resolution);
  const float whole = fminf(floorf(scaled), resolution - 1);  // the last cell holds the far face
  *cell = static_cast<std::uint32_t>(whole);
  return scaled - whole;
}

__device__ inline GridCell findCell(const CudaGridLevel& level, const float p[3]) {
  GridCell cell;
  std::uint32_t x, y, z;
  cell.fx = splitCell(p[0], level.resolution, &x);
  cell.fy = splitCell(p[1], level.resolution, &y);
  cell.fz = splitCell(p[2], level.resolution, &z);
  const std::uint32_t y0 = y * level.stride_y, y1 = y0 + level.stride_y;
  const std::uint32_t z0 = z * level.stride_z, z1 = z0 + level.stride_z;
  if (level.hashed) {
    const std::uint32_t rows[4] = {y0 ^ z0, y1 ^ z0, y0 ^ z1, y1 ^ z1};
#pragma unroll
    for (int r = 0; r < 4; ++r) {
      cell.low[r] = ((x ^ rows[r]) & level.mask) + level.offset;
      cell.high[r] = (((x + 1) ^ rows[r]) & level.mask) + level.offset;
    }
  } else {
    const std::uint32_t base = x + level.offset;
    const std::uint32_t rows[4] = {y0 + z0, y1 + z0, y0 + z1, y1 + z1};
#pragma unroll
    for (int r = 0; r < 4; ++r) {
      cell.low[r] = base + rows[r];
      cell.high[r] = base + rows[r] + 1;
    }
  }
  return cell;
}

/// Reads the eight corners' entries; all gathers are on their way before the first is used.
template <int F>
__device__ inline void gatherCorners(const void* grid, const GridCell& cell,
                                     typename GridEntry<F>::Entry (&low)[4],
                                     typename GridEntry<F>::Entry (&high)[4]) {
  using Entry = typename GridEntry<F>::Entry;
  const Entry* entries = static_cast<const Entry*>(grid);
  if constexpr (F == 8) {
#pragma unroll
    for (int r = 0; r < 4; ++r) {
      low[r] = __ldg(entries + cell.low[r]);
      high[r] = __ldg(entries + cell.high[r]);
    }
  } else {
    using Pair = typename GridEntry<F>::Pair;
    const Pair* pairs = static_cast<const Pair*>(grid);
    Pair pair[4];
    Entry alone[4];
#pragma unroll
    for (int r = 0; r < 4; ++r) {
      pair[r] = __ldg(pairs + (cell.low[r] >> 1));
      alone[r] = Entry();
      if ((cell.low[r] ^ cell.high[r]) != 1) alone[r] = __ldg(entries + cell.high[r]);
    }
#pragma unroll
    for (int r = 0; r < 4; ++r) {
      const bool odd = cell.low[r] & 1;
      const bool together = (cell.low[r] ^ cell.high[r]) == 1;
      const Entry a = GridEntry<F>::low(pair[r]), b = GridEntry<F>::high(pair[r]);
      low[r] = odd ? b : a;
      high[r] = together ? (odd ? a : b) : alone[r];
    }
  }
}

/// Derivatives of features along the axes, per cell.
template <int F>
struct FeatureSlopes {
  float x[F], y[F], z[F];
};

/// A cell, and its corners' entries on their way.
template <int F>
struct Corners {
  GridCell cell;
  typename GridEntry<F>::Entry low[4], high[4];
};

template <int F>
__device__ inline void findCorners(const void* grid, const CudaGridLevel& level, const float p[3],
                                   Corners<F>* corners) {
  corners->cell = findCell(level, p);
  gatherCorners<F>(grid, corners->cell, corners->low, corners->high);
}

/// Features of a position from its cell. @param slopes may be null.
template <int F>
__device__ inline void interpolate(const Corners<F>& corners, float out[F],
                                   FeatureSlopes<F>* slopes) {
  const GridCell& cell = corners.cell;
  const float wy[2] = {1 - cell.fy, cell.fy}, wz[2] = {1 - cell.fz, cell.fz};
#pragma unroll
  for (int f = 0; f < F; ++f) {
    out[f] = 0;
    if (slopes) slopes->x[f] = slopes->y[f] = slopes->z[f] = 0;
  }
#pragma unroll
  for (int r = 0; r < 4; ++r) {
    const float w = __fmul_rn(wy[r & 1], wz[r >> 1]);
    float a[F], b[F];
    GridEntry<F>::unpack(corners.low[r], a);
    GridEntry<F>::unpack(corners.high[r], b);
    // Written out, so that features have the same bits with slopes and without.
    const float wa = __fmul_rn(w, 1 - cell.fx), wb = __fmul_rn(w, cell.fx);
#pragma unroll
    for (int f = 0; f < F; ++f) out[f] = __fmaf_rn(wb, b[f], __fmaf_rn(wa, a[f], out[f]));
    if (slopes != nullptr) {
      const float sy = r & 1 ? wz[r >> 1] : -wz[r >> 1];
      const float sz = r >> 1 ? wy[r & 1] : -wy[r & 1];
#pragma unroll
      for (int f = 0; f < F; ++f) {
        const float along = b[f] - a[f], v = a[f] + cell.fx * along;
        slopes->x[f] += w * along;
        slopes->y[f] += sy * v;
        slopes->z[f] += sz * v;
      }
    }
  }
}

__device__ inline uint4 packEight(const float v[8]) {
  const __half2 a = __floats2half2_rn(v[0], v[1]), b = __floats2half2_rn(v[2], v[3]);
  const __half2 c = __floats2half2_rn(v[4], v[5]), d = __floats2half2_rn(v[6], v[7]);
  return make_uint4(*reinterpret_cast<const unsigned*>(&a), *reinterpret_cast<const unsigned*>(&b),
                    *reinterpret_cast<const unsigned*>(&c), *reinterpret_cast<const unsigned*>(&d));
}

__device__ inline void unpackEight(const uint4& packed, float v[8]) {
  GridEntry<8>::unpack(packed, v);
}

/// All features of a position as halves. @param row 16 encoding_tiles halves, aligned to 16 bytes.
/// @param slope_rows null, or three rows, `slope_plane` halves apart, for d / dx, dy, dz.
template <int F, bool kSlopes>
__device__ inline void encodeWith(const CudaFieldView& field, const float p[3], __half* row,
                                  __half* slope_rows, int slope_plane) {
  constexpr int kLevels = 8 / F;  // that fill 16 bytes
  for (int unit = 0; unit < 2 * field.shape.encoding_tiles; ++unit) {
    // The gathers of all these levels are on their way before the first is waited for. Behind the
    // last level the last one is read again, so that nothing branches here.
    Corners<F> corners[kLevels];
#pragma unroll
    for (int l = 0; l < kLevels; ++l) {
      const int level = min(unit * kLevels + l, field.level_count - 1);
      findCorners<F>(field.grid, field.levels[level], p, &corners[l]);
    }
    float v[8], sx[8], sy[8], sz[8];
#pragma unroll
    for (int l = 0; l < kLevels; ++l) {
      FeatureSlopes<F> slopes;
      interpolate<F>(corners[l], v + l * F, kSlopes ? &slopes : nullptr);
      const bool exists = unit * kLevels + l < field.level_count;
#pragma unroll
      for (int f = 0; f < F; ++f) {
        const int i = l * F + f;
        if (!exists) v[i] = 0;
        if (kSlopes) {
          sx[i] = exists ? slopes.x[f] : 0.0f;
          sy[i] = exists ? slopes.y[f] : 0.0f;
          sz[i] = exists ? slopes.z[f] : 0.0f;
        }
      }
    }
    *reinterpret_cast<uint4*>(row + 8 * unit) = packEight(v);
    if (kSlopes) {
      __half* to = slope_rows + 8 * unit;
      *reinterpret_cast<uint4*>(to) = packEight(sx);
      *reinterpret_cast<uint4*>(to + slope_plane) = packEight(sy);
      *reinterpret_cast<uint4*>(to + 2 * slope_plane) = packEight(sz);
    }
  }
}

template <bool kSlopes>
__device__ inline void encode(const CudaFieldView& field, const float p[3], __half* row,
                              __half* slope_rows, int slope_plane) {
  switch (field.features) {
    case 2:
      return encodeWith<2, kSlopes>(field, p, row, slope_rows, slope_plane);
    case 4:
      return encodeWith<4, kSlopes>(field, p, row, slope_rows, slope_plane);
    default:
      return encodeWith<8, kSlopes>(field, p, row, slope_rows, slope_plane);
  }
}

/// Gradient of a loss by the position, in N, from its gradient by the features (a row as encode
/// writes it) and the slopes.
__device__ inline void positionGradient(const CudaFieldView& field, const __half* gradient_row,
                                        const __half* slope_rows, int slope_plane, float out[3]) {
  const int feature_bits = 31 - __clz(field.features);
  out[0] = out[1] = out[2] = 0;
  for (int unit = 0; unit < 2 * field.shape.encoding_tiles; ++unit) {
    float g[8];
    unpackEight(*reinterpret_cast<const uint4*>(gradient_row + 8 * unit), g);
    float scaled[8];
#pragma unroll
    for (int i = 0; i < 8; ++i) {
      const int level = (8 * unit + i) >> feature_bits;
      scaled[i] = level < field.level_count ? g[i] * field.levels[level].resolution : 0.0f;
    }
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      float s[8];
      unpackEight(*reinterpret_cast<const uint4*>(slope_rows + a * slope_plane + 8 * unit), s);
#pragma unroll
      for (int i = 0; i < 8; ++i) out[a] += scaled[i] * s[i];
    }
  }
}

}  // namespace nerf_pose_refiner
