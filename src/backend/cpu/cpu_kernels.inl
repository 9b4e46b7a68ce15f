// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// The field's arithmetic, compiled once per instruction set by the cpp files that include this.
// Everything is in an anonymous namespace and uses neither Eigen nor templates of the standard
// library: a function of this file that the linker merged with another's would carry its
// instructions to processors that lack them. The vectors are GCC's and Clang's own extension; the
// compiler maps them to what the target has, so the code is the same for all.

#include <stdint.h>
#include <string.h>
#if defined(__AVX2__) && defined(__F16C__)
#include <immintrin.h>
#endif

#include "backend/cpu/cpu_kernels.h"

// Its parts, each of which uses those above it.
#include "backend/cpu/kernels_vectors.inl"

#include "backend/cpu/kernels_hash_grid.inl"

#include "backend/cpu/kernels_empty_space.inl"

#include "backend/cpu/kernels_networks.inl"

namespace nerf_pose_refiner {
namespace {

constexpr CpuKernels makeKernels(const char* name) {
  return {name,
          firstSamples,
          encode,
          encodePositionGradient,
          encodeGridGradient,
          layer,
          layerWeightGradient,
          reluGradient,
          exponential,
          sigmoid,
          adam};
}

}  // namespace
}  // namespace nerf_pose_refiner
