// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

namespace nerf_pose_refiner {

constexpr long kGathersPerLaunch = 1L << 28;

/// Reads kGathersPerLaunch random entries of a table. @param mask its entries - 1.
void gatherOnce(const std::uint64_t* table, unsigned mask, unsigned* sink, cudaStream_t stream);

/// Operations of multiplyOnce: dense products of halves with sums in floats, a multiplication and
/// an addition each.
constexpr double kOperationsPerLaunch = 2.0 * 16 * 8 * 16 * 8 * 2048 * 8 * 1024;

/// Products on the tensor cores, operands in registers.
void multiplyOnce(float* sink, cudaStream_t stream);

}  // namespace nerf_pose_refiner
