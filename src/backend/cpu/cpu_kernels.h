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
  const std::uint8_t* distance;  ///< [coarse^3], to the nearest occupied one, in coarse cells
  const std::uint8_t* bits;      ///< [fine^3], 1: occupied
  int coarse;
  int fine;
  float box_min[3], box_max[3];
  float near;
  float step;
};

/// The kernels work on whole groups of so many columns, which are samples or rays.
constexpr int kColumnGroup = 16;

/// A matrix with a column per sample: row r of column s is at data[r * stride + s]. `columns`
/// is a multiple of kColumnGroup, rows are aligned to 64 bytes.
struct KernelRows {
  float* data;
  int rows, columns, stride;
};
struct ConstKernelRows {
  const float* data;
  int rows, columns, stride;
};

/// Rays in N: coordinate a of ray r is origin[a][r].
struct KernelRays {
  const float* origin[3];
  const float* direction[3];  ///< unit length
  const float* offset;        ///< [0, 1): intervals start so many steps before the box is entered
  int count;                  ///< a multiple of kColumnGroup
};

/// Numbers that are trained, with Adam's moments of their gradients.
struct KernelParameters {
  float* values;
  float* first_moment;
  float* second_moment;
  float* gradient;
  std::uint16_t* half_values;  ///< the values as half bits, or null
  std::int64_t count;          ///< a multiple of kColumnGroup
};

struct KernelAdam {
  float learning_rate, beta1, beta2, epsilon;
};

/// The field's arithmetic for one instruction set. Positions are in the cube N, [0, 1]: coordinate
/// a of sample s is position[a][s].
struct CpuKernels {
  const char* name;

  /// For each ray the first interval whose middle lies in an occupied cell, or -1; @see RayMarcher.
  void (*firstSamples)(const KernelSpace& space, const KernelRays& rays, std::int32_t* first);

  /// Features at the positions: rows [level * features + f].
  void (*encode)(const KernelGrid& grid, const float* const position[3], KernelRows out);

  /// gradient[a][s] += sum over rows of out_gradient * d row / d axis a (units of N).
  void (*encodePositionGradient)(const KernelGrid& grid, const float* const position[3],
                                 ConstKernelRows out_gradient, float* const gradient[3]);

  /// Adds the gradients of one level's features to its entries: grid_gradient is [entry][features]
  /// of that level, out_gradient holds the level's rows only.
  void (*encodeGridGradient)(const KernelGrid& grid, int level, const float* const position[3],
                             ConstKernelRows out_gradient, float* grid_gradient);

  /// out = weights * in, with weights [out.rows][in.rows]; negative results become 0 if relu.
  /// out.rows is a multiple of 4.
  void (*layer)(const float* weights, ConstKernelRows in, KernelRows out, bool relu);

  /// weight_gradient[o][i] += sum over columns of out_gradient[o] * in[i]; out_gradient.rows is a
  /// multiple of 4.
  void (*layerWeightGradient)(ConstKernelRows out_gradient, ConstKernelRows in,
                              float* weight_gradient);

  /// gradient = activation > 0 ? gradient : 0, elementwise.
  void (*reluGradient)(ConstKernelRows activation, KernelRows gradient);

  /// out[s] = exp(min(in[s], 30)).
  void (*exponential)(const float* in, float* out, int n);

  /// out[s] = 1 / (1 + exp(-in[s])).
  void (*sigmoid)(const float* in, float* out, int n);

  /// A step of Adam without bias correction; numbers with a gradient of exactly 0 are left alone.
  /// Gradients are cleared.
  void (*adam)(const KernelParameters& parameters, const KernelAdam& adam);
};

/// Kernels for any processor, and for x86-64 with AVX2, FMA and F16C (null where not compiled).
const CpuKernels* baselineKernels();
const CpuKernels* avx2Kernels();

/// "auto" (the best that this processor runs), "baseline" or "avx2".
/// @throws std::invalid_argument for another name, std::runtime_error if it cannot run here.
const CpuKernels& selectCpuKernels(const std::string& instruction_set);

}  // namespace nerf_pose_refiner
