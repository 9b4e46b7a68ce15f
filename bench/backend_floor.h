// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>

#include "backend/backend.h"
#include "floor.h"

namespace nerf_pose_refiner {

/// What the backend's processor can do at best: of a device, matrix products in half precision
/// count as operations. @param threads of the CPU. @param table_bytes of the table that is gathered
/// from.
Floor measureBackendFloor(const BackendInfo& backend, int threads, std::size_t table_bytes);

/// Memory of the device in use [MiB]; before the first backend is made, that is its context. 0
/// without CUDA.
double deviceMemory_MiB();

}  // namespace nerf_pose_refiner
