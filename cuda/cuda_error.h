// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include <string>

namespace nerf_pose_refiner {

/// Throws std::runtime_error with file, line, call and CUDA's text unless `error` is cudaSuccess.
/// An error that a call left behind is taken off, so that the next call starts clean. An error that
/// stays with the process is thrown as BackendLost.
void checkCuda(cudaError_t error, const char* call, const char* file, int line);

/// Whether an error stays: all later calls of the process fail with it. (cudaDeviceReset would end
/// it, and with it the work of all other code of the process on that device.)
bool isSticky(cudaError_t error);

/// The first error of this process that stays, in words; empty: there was none. Any thread.
std::string stickyError();

}  // namespace nerf_pose_refiner

/// Wrap every CUDA call in this; after a kernel's launch write
/// NPR_CUDA_CHECK(cudaGetLastError()).
#define NPR_CUDA_CHECK(call) ::nerf_pose_refiner::checkCuda((call), #call, __FILE__, __LINE__)
