// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "cuda_error.h"

namespace nerf_pose_refiner {

/// Blocks of a kernel that the current device holds at once, with that much dynamic shared memory
/// allowed to them. What was found is remembered.
int residentBlocks(const void* kernel, int threads, int shared_bytes);

/// Threads of a block: those wanted, or half as many, and so on, until their shared memory fits.
int threadsThatFit(int threads, int block_bytes, int warp_bytes);

/// Launches as many blocks as the device holds at once; such kernels take their work from a
/// counter.
template <typename... Parameters, typename... Arguments>
void launchPersistent(void (*kernel)(Parameters...), int threads, int shared_bytes,
                      cudaStream_t stream, const Arguments&... arguments) {
  const int blocks = residentBlocks(reinterpret_cast<const void*>(kernel), threads, shared_bytes);
  kernel<<<blocks, threads, shared_bytes, stream>>>(arguments...);
  NPR_CUDA_CHECK(cudaGetLastError());
}

}  // namespace nerf_pose_refiner
