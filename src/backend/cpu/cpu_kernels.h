// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

namespace nerf_pose_refiner {

/// A level of a hash grid as the kernels see it.
struct KernelGridLevel {
  std::uint32_t resolution;
  std::uint32_t entries;
  std::uint32_t offset;
  std::uint32_t hashed;
};

/// A hash grid as the kernels see it; values are [entry][features] half bits.
struct KernelGrid {
  const KernelGridLevel* levels;
  const std::uint16_t* values;
  int level_count;
  int features;
};

/// Empty space as the kernels see it; @see OccupancyMask. Lengths in units of N.
struct KernelSpace {
  const std::uint8_t* distance;  ///< [coarse^3], to the nearest matter, in coarse cells
  const std::uint8_t* bits;      ///< [fine^3], 1: matter
  int coarse;
  int fine;
  float box_min[3], box_max[3];
  float near;
  float step;
};

/// Columns of samples: row r of sample s stands at data[r * stride + s]. The kernels work on whole
/// groups of kColumnGroup columns: n is a multiple of it, rows are aligned to 64 bytes.
constexpr int kColumnGroup = 16;

/// The field's arithmetic for one instruction set. Positions are in the cube N, [0, 1].
struct CpuKernels {
  const char* name;

  /// For each of n rays the first interval whose middle lies in an occupied cell, or -1. Interval k
  /// starts k - offset steps behind the point where the ray enters the box; @see RayMarcher.
  void (*firstSamples)(const KernelSpace& space, const float* const origin[3],
                       const float* const direction[3], const float* offset, int n,
                       std::int32_t* first);

  /// Features of n positions: rows [level * features + f].
  void (*encode)(const KernelGrid& grid, const float* x, const float* y, const float* z, int n,
                 float* out, int stride);

  /// gradient_x[s] += sum over rows of out_gradient * d row / dx; likewise y, z (units of N).
  void (*encodePositionGradient)(const KernelGrid& grid, const float* x, const float* y,
                                 const float* z, int n, const float* out_gradient, int stride,
                                 float* gradient_x, float* gradient_y, float* gradient_z);

  /// Adds the gradients of one level's features to its entries: grid_gradient is [entry][features]
  /// of that level, out_gradient holds the level's rows only.
  void (*encodeGridGradient)(const KernelGrid& grid, int level, const float* x, const float* y,
                             const float* z, int n, const float* out_gradient, int stride,
                             float* grid_gradient);

  /// out = weights * in, with weights [outputs][inputs]; negative results become 0 if relu.
  /// outputs is a multiple of 4.
  void (*layer)(const float* weights, int outputs, int inputs, const float* in, float* out, int n,
                int stride, bool relu);

  /// weight_gradient[o][i] += sum over columns of out_gradient[o] * in[i]; outputs % 4 == 0.
  void (*layerWeightGradient)(int outputs, int inputs, const float* out_gradient, const float* in,
                              int n, int stride, float* weight_gradient);

  /// gradient = activation > 0 ? gradient : 0, elementwise over rows.
  void (*reluGradient)(const float* activation, float* gradient, int rows, int n, int stride);

  /// out[s] = exp(min(in[s], 30)).
  void (*exponential)(const float* in, float* out, int n);

  /// out[s] = 1 / (1 + exp(-in[s])).
  void (*sigmoid)(const float* in, float* out, int n);

  /// Adam on n numbers (a multiple of kColumnGroup); those with a gradient of exactly 0 are left
  /// alone. Gradients are cleared. half_values (may be null) gets the result.
  void (*adam)(float* values, float* first_moment, float* second_moment, float* gradient,
               std::uint16_t* half_values, std::int64_t n, float learning_rate, float beta1,
               float beta2, float epsilon);
};

/// Kernels for any processor, and for x86-64 with AVX2, FMA and F16C (null where not compiled).
const CpuKernels* baselineKernels();
const CpuKernels* avx2Kernels();

/// "auto" (the best that this processor runs), "baseline" or "avx2".
/// @throws std::invalid_argument for another name, std::runtime_error if it cannot run here.
const CpuKernels& selectCpuKernels(const std::string& instruction_set);

}  // namespace nerf_pose_refiner
