// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "backend/loaded_field.h"
#include "field/field.h"

namespace nerf_pose_refiner {

/// What a CUDA device can do at most, for benchmarks to compare with.
struct DeviceFloor {
  std::string name;
  double bytes_per_s = 0;    ///< copied within its memory, read and written counted
  double gathers_per_s = 0;  ///< of 8 bytes, random, from a table of that size
  double flops_per_s = 0;    ///< products of halves on the tensor cores
};
DeviceFloor measureDeviceFloor(std::size_t table_bytes);

/// Memory of the device in use by all of its programs [bytes].
std::size_t deviceMemoryUsed();

/// Seconds that evaluations of a field take, each alone, by the device's own clock.
/// @param positions [n][3] in N. @param directions [n][3].
/// @param with_gradient back to the positions, too.
std::vector<double> timeEvaluations(const Field& field, const std::vector<float>& positions,
                                    const std::vector<float>& directions, bool with_gradient,
                                    int repetitions);

/// The same for renderings, without the way of the image to the host.
std::vector<double> timeRenderings(const Field& field, const View& view, int repetitions);

}  // namespace nerf_pose_refiner
