// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_fp16.h>

#include <cstdint>

#include "field_view.h"

namespace nerf_pose_refiner {

/// Matrix products of one warp on the tensor cores: 32 rows (samples) as two tiles of 16, halves
/// in, floats out. Operands stay in registers: the sums of one layer are, converted to halves, the
/// inputs of the next, lane by lane (mma.m16n8k16: PTX ISA, "Matrix Fragments").
///
/// Lane 4 g + t holds of a tile's sums: rows g (c[0], c[1]) and g + 8 (c[2], c[3]), columns 2 t and
/// 2 t + 1.
constexpr unsigned kWholeWarp = 0xffffffffu;

/// 32 rows x 16 KT inputs.
template <int KT>
struct TileInputs {
  std::uint32_t a[2][KT][4];
};

/// 32 rows x 8 NT sums.
template <int NT>
struct TileSums {
  float c[2][NT][4];
};

__device__ inline void multiplyTile(float (&c)[4], const std::uint32_t (&a)[4], const uint2& b) {
#if __CUDA_ARCH__ >= 800
  asm("mma.sync.aligned.m16n8k16.row.col.f32.f16.f16.f32 {%0,%1,%2,%3}, {%4,%5,%6,%7}, {%8,%9}, "
      "{%0,%1,%2,%3};"
      : "+f"(c[0]), "+f"(c[1]), "+f"(c[2]), "+f"(c[3])
      : "r"(a[0]), "r"(a[1]), "r"(a[2]), "r"(a[3]), "r"(b.x), "r"(b.y));
#else
  asm("mma.sync.aligned.m16n8k8.row.col.f32.f16.f16.f32 {%0,%1,%2,%3}, {%4,%5}, {%6}, "
      "{%0,%1,%2,%3};"
      : "+f"(c[0]), "+f"(c[1]), "+f"(c[2]), "+f"(c[3])
      : "r"(a[0]), "r"(a[1]), "r"(b.x));
  asm("mma.sync.aligned.m16n8k8.row.col.f32.f16.f16.f32 {%0,%1,%2,%3}, {%4,%5}, {%6}, "
      "{%0,%1,%2,%3};"
      : "+f"(c[0]), "+f"(c[1]), "+f"(c[2]), "+f"(c[3])
      : "r"(a[2]), "r"(a[3]), "r"(b.y));
#endif
}

/// Reads 16 x 16 halves from shared memory; lane i gives the address of 8 halves: of row
/// i % 16, columns 0..7 for the first 16 lanes and 8..15 for the others.
__device__ inline void loadTile(std::uint32_t (&a)[4], const __half* address) {
  const std::uint32_t shared = static_cast<std::uint32_t>(__cvta_generic_to_shared(address));
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.shared.b16 {%0,%1,%2,%3}, [%4];"
               : "=r"(a[0]), "=r"(a[1]), "=r"(a[2]), "=r"(a[3])
               : "r"(shared)
               : "memory");
}

/// The same with rows and columns exchanged: what a product takes of a matrix that stands in memory
/// transposed. Lane i gives the address of 8 halves of row i % 8 of the quarter i / 8.
__device__ inline void loadTransposed(std::uint32_t (&a)[4], const __half* address) {
  const std::uint32_t shared = static_cast<std::uint32_t>(__cvta_generic_to_shared(address));
  asm volatile("ldmatrix.sync.aligned.m8n8.x4.trans.shared.b16 {%0,%1,%2,%3}, [%4];"
               : "=r"(a[0]), "=r"(a[1]), "=r"(a[2]), "=r"(a[3])
               : "r"(shared)
               : "memory");
}

__device__ inline std::uint32_t packHalves(float low, float high) {
  const __half2 pair = __floats2half2_rn(low, high);
  return *reinterpret_cast<const std::uint32_t*>(&pair);
}

template <int NT>
__device__ inline void clearSums(TileSums<NT>* sums) {
#pragma unroll
  for (int m = 0; m < 2; ++m) {
#pragma unroll
    for (int n = 0; n < NT; ++n) {
#pragma unroll
      for (int i = 0; i < 4; ++i) sums->c[m][n][i] = 0;
    }
  }
}

/// Adds 16 inputs' products. @param weights tiles [NT][32 lanes].
template <int NT>
__device__ inline void multiplyInputs(const std::uint32_t (&a0)[4], const std::uint32_t (&a1)[4],
                                      const uint2* weights, int lane, TileSums<NT>* sums) {
#pragma unroll
  for (int n = 0; n < NT; ++n) {
    const uint2 b = weights[n * 32 + lane];
    multiplyTile(sums->c[0][n], a0, b);
    multiplyTile(sums->c[1][n], a1, b);
  }
}

/// A whole layer. @param weights tiles [KT][NT][32 lanes].
template <int KT, int NT>
__device__ inline void multiplyLayer(const TileInputs<KT>& in, const uint2* weights, int lane,
                                     TileSums<NT>* sums) {
  clearSums(sums);
#pragma unroll
  for (int k = 0; k < KT; ++k) {
    multiplyInputs(in.a[0][k], in.a[1][k], weights + k * NT * 32, lane, sums);
  }
}

/// Sums as the next layer's inputs.
template <int NT>
__device__ inline TileInputs<NT / 2> toInputs(const TileSums<NT>& sums) {
  TileInputs<NT / 2> in;
#pragma unroll
  for (int m = 0; m < 2; ++m) {
#pragma unroll
    for (int k = 0; k < NT / 2; ++k) {
#pragma unroll
      for (int i = 0; i < 4; ++i) {
        const float* c = sums.c[m][2 * k + i / 2] + 2 * (i % 2);
        in.a[m][k][i] = packHalves(c[0], c[1]);
      }
    }
  }
  return in;
}

/// Writes inputs as halves to 32 rows of memory. @param stride of the rows, even.
template <int KT>
__device__ inline void storeInputs(const TileInputs<KT>& in, __half* rows, int stride, int lane) {
#pragma unroll
  for (int m = 0; m < 2; ++m) {
#pragma unroll
    for (int k = 0; k < KT; ++k) {
#pragma unroll
      for (int i = 0; i < 4; ++i) {
        const int row = 16 * m + lane / 4 + 8 * (i % 2);
        const int column = 16 * k + 8 * (i / 2) + 2 * (lane % 4);
        *reinterpret_cast<std::uint32_t*>(rows + row * stride + column) = in.a[m][k][i];
      }
    }
  }
}

template <int NT>
__device__ inline void applyRelu(TileSums<NT>* sums) {
#pragma unroll
  for (int m = 0; m < 2; ++m) {
#pragma unroll
    for (int n = 0; n < NT; ++n) {
#pragma unroll
      for (int i = 0; i < 4; ++i) sums->c[m][n][i] = fmaxf(sums->c[m][n][i], 0.0f);
    }
  }
}

/// Writes sums as the next layer's inputs [first, first + NT / 2).
template <int NT, int KT>
__device__ inline void placeInputs(const TileSums<NT>& sums, int first, TileInputs<KT>* in) {
  const TileInputs<NT / 2> part = toInputs(sums);
#pragma unroll
  for (int m = 0; m < 2; ++m) {
#pragma unroll
    for (int k = 0; k < NT / 2; ++k) {
#pragma unroll
      for (int i = 0; i < 4; ++i) in->a[m][first + k][i] = part.a[m][k][i];
    }
  }
}

/// Notes which of a lane's sums are positive: bit 4 (first + n) + i of word m. At most 8 tiles.
template <int NT>
__device__ inline void addPositiveBits(const TileSums<NT>& sums, int first,
                                       std::uint32_t (&bits)[2]) {
#pragma unroll
  for (int m = 0; m < 2; ++m) {
#pragma unroll
    for (int n = 0; n < NT; ++n) {
#pragma unroll
      for (int i = 0; i < 4; ++i) {
        bits[m] |= (sums.c[m][n][i] > 0 ? 1u : 0u) << (4 * (first + n) + i);
      }
    }
  }
}

/// Clears the sums whose bit is 0.
template <int NT>
__device__ inline void applyBits(const std::uint32_t (&bits)[2], int first, TileSums<NT>* sums) {
#pragma unroll
  for (int m = 0; m < 2; ++m) {
#pragma unroll
    for (int n = 0; n < NT; ++n) {
#pragma unroll
      for (int i = 0; i < 4; ++i) {
        if ((bits[m] >> (4 * (first + n) + i) & 1u) == 0) sums->c[m][n][i] = 0;
      }
    }
  }
}

}  // namespace nerf_pose_refiner
