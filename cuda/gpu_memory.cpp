// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/gpu_memory.h"

#include <cuda_runtime_api.h>

#include "backend/make_backend.h"
#include "cuda_error.h"

namespace nerf_pose_refiner {

std::optional<GpuMemory> gpuMemory(int device) {
  if (!whyNoCuda(device).empty()) return std::nullopt;
  int before = 0;  // the thread's device is its owner's affair
  NPR_CUDA_CHECK(cudaGetDevice(&before));
  NPR_CUDA_CHECK(cudaSetDevice(device));
  std::size_t free_bytes = 0, total_bytes = 0;
  NPR_CUDA_CHECK(cudaMemGetInfo(&free_bytes, &total_bytes));
  NPR_CUDA_CHECK(cudaSetDevice(before));
  return GpuMemory{total_bytes - free_bytes, total_bytes};
}

}  // namespace nerf_pose_refiner
