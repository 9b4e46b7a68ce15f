// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

namespace nerf_pose_refiner {

/// Throws std::runtime_error with file, line, call and CUDA's text unless `error` is cudaSuccess.
/// An error that a call left behind is taken off, so that the next call starts clean.
void checkCuda(cudaError_t error, const char* call, const char* file, int line);

}  // namespace nerf_pose_refiner

/// Wrap every CUDA call in this; after a kernel's launch write
/// NPR_CUDA_CHECK(cudaGetLastError()).
#define NPR_CUDA_CHECK(call) ::nerf_pose_refiner::checkCuda((call), #call, __FILE__, __LINE__)
