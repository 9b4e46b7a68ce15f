// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "hash_encoding.cuh"

namespace nerf_pose_refiner {

/// Adds N floats to memory that many threads add to; at once where the architecture can. The order
/// of such sums is not fixed.
template <int N>
__device__ inline void addAtomically(float* to, const float v[N]) {
#if __CUDA_ARCH__ >= 900 && \
    (__CUDACC_VER_MAJOR__ > 12 || (__CUDACC_VER_MAJOR__ == 12 && __CUDACC_VER_MINOR__ >= 1))
  if constexpr (N == 2) {
    asm volatile("red.global.add.v2.f32 [%0], {%1,%2};" ::"l"(to), "f"(v[0]), "f"(v[1]) : "memory");
  } else {
#pragma unroll
    for (int i = 0; i < N; i += 4) {
      asm volatile("red.global.add.v4.f32 [%0], {%1,%2,%3,%4};" ::"l"(to + i), "f"(v[i]),
                   "f"(v[i + 1]), "f"(v[i + 2]), "f"(v[i + 3])
                   : "memory");
    }
  }
#else
#pragma unroll
  for (int i = 0; i < N; ++i) atomicAdd(to + i, v[i]);
#endif
}

/// Adds a feature gradient to the corners of a position's cell at one level, by their weights.
/// @param table gradient of the whole table, [entry][F].
template <int F>
__device__ inline void scatterLevel(const CudaGridLevel& level, const float p[3],
                                    const float gradient[F], float* table) {
  const GridCell cell = findCell(level, p);
  const float wy[2] = {1 - cell.fy, cell.fy}, wz[2] = {1 - cell.fz, cell.fz};
#pragma unroll
  for (int r = 0; r < 4; ++r) {
    const float w = wy[r & 1] * wz[r >> 1];
    float low[F], high[F];
#pragma unroll
    for (int f = 0; f < F; ++f) {
      low[f] = w * (1 - cell.fx) * gradient[f];
      high[f] = w * cell.fx * gradient[f];
    }
    addAtomically<F>(table + static_cast<std::size_t>(cell.low[r]) * F, low);
    addAtomically<F>(table + static_cast<std::size_t>(cell.high[r]) * F, high);
  }
}

/// Carries the gradient of a position's encoding (a row as encode writes it) to the table.
/// @return whether it is finite; if not, nothing is carried of the part that is not.
template <int F>
__device__ inline bool sampleWith(const CudaFieldView& field, const float p[3],
                                  const __half* gradient_row, float* table) {
  constexpr int kLevels = 8 / F;  // that fill 16 bytes
  bool finite = true;
  for (int unit = 0; unit < 2 * field.shape.encoding_tiles; ++unit) {
    float g[8];
    unpackEight(*reinterpret_cast<const uint4*>(gradient_row + 8 * unit), g);
#pragma unroll
    for (int l = 0; l < kLevels; ++l) {
      const int level = unit * kLevels + l;
      if (level >= field.level_count) break;
      float size = 0;
#pragma unroll
      for (int f = 0; f < F; ++f) size += fabsf(g[l * F + f]);
      finite = finite && isfinite(size);
      if (size > 0 && isfinite(size)) scatterLevel<F>(field.levels[level], p, g + l * F, table);
    }
  }
  return finite;
}

__device__ inline bool scatterGradient(const CudaFieldView& field, const float p[3],
                                       const __half* gradient_row, float* table) {
  switch (field.features) {
    case 2:
      return sampleWith<2>(field, p, gradient_row, table);
    case 4:
      return sampleWith<4>(field, p, gradient_row, table);
    default:
      return sampleWith<8>(field, p, gradient_row, table);
  }
}

}  // namespace nerf_pose_refiner
