// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/cpu/cpu_kernels.h"
#include "field/field.h"

namespace nerf_pose_refiner {

/// A layer as the kernels take it: rows of zeros make both sizes multiples of 4.
struct CpuLayer {
  int inputs = 0;   ///< padded
  int outputs = 0;  ///< padded
  int true_inputs = 0, true_outputs = 0;
  bool relu = false;
  std::vector<float> weights;     ///< [outputs][inputs]
  std::vector<float> transposed;  ///< [inputs][outputs], for the way back

  /// @param padded [outputs][inputs]
  void setWeights(const std::vector<float>& padded);
};

/// The two networks of a field and its grid, in the kernels' form.
struct CpuNetworks {
  std::vector<CpuLayer> density;  ///< encoding -> 1 + geometry features
  std::vector<CpuLayer> colour;   ///< spherical harmonics, geometry features -> RGB
  std::vector<KernelGridLevel> levels;
  int features = 0;
  int encoding_rows = 0;  ///< levels * features: inputs of the density network

  explicit CpuNetworks(const FieldConfig& config);

  /// Takes over weights laid out as in Field.
  void assign(const std::vector<float>& density_weights, const std::vector<float>& colour_weights);

  double gathersPerSample() const { return 8.0 * static_cast<double>(levels.size()); }
  double interpolationFlops() const;  ///< of a sample
  double densityFlops() const;        ///< of a sample: interpolation and density network
  double colourFlops() const;
};

/// The weights of a network in the compact layout of Field.
void gatherWeights(const std::vector<CpuLayer>& layers, float* compact);

}  // namespace nerf_pose_refiner
