// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <map>
#include <mutex>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "cuda_error.h"

namespace nerf_pose_refiner {

int residentBlocks(const void* kernel, int threads, int shared_bytes) {
  // The limit belongs to the kernel, not to the thread: backends and keyframe aligners launch from
  // several threads.
  static std::mutex mutex;
  static std::map<std::tuple<int, const void*, int>, int> known;
  static std::map<std::pair<int, const void*>, int> largest;
  int device = 0;
  NPR_CUDA_CHECK(cudaGetDevice(&device));
  std::lock_guard<std::mutex> lock(mutex);
  int& blocks = known[{device, kernel, shared_bytes}];
  if (blocks > 0) return blocks;
  int processors = 0, allowed = 0, per_processor = 0;
  NPR_CUDA_CHECK(cudaDeviceGetAttribute(&processors, cudaDevAttrMultiProcessorCount, device));
  NPR_CUDA_CHECK(cudaDeviceGetAttribute(&allowed, cudaDevAttrMaxSharedMemoryPerBlockOptin, device));
  if (shared_bytes > allowed) {
    throw std::runtime_error("CUDA: the field's networks need " + std::to_string(shared_bytes) +
                             " bytes of shared memory, this device has " + std::to_string(allowed));
  }
  // It must not fall below what another field needs.
  int& limit = largest[{device, kernel}];
  limit = std::max(limit, shared_bytes);
  NPR_CUDA_CHECK(cudaFuncSetAttribute(kernel, cudaFuncAttributeMaxDynamicSharedMemorySize, limit));
  NPR_CUDA_CHECK(
      cudaOccupancyMaxActiveBlocksPerMultiprocessor(&per_processor, kernel, threads, shared_bytes));
  blocks = processors * (per_processor > 0 ? per_processor : 1);
  return blocks;
}

int threadsThatFit(int threads, int block_bytes, int warp_bytes) {
  int device = 0, allowed = 0;
  NPR_CUDA_CHECK(cudaGetDevice(&device));
  NPR_CUDA_CHECK(cudaDeviceGetAttribute(&allowed, cudaDevAttrMaxSharedMemoryPerBlockOptin, device));
  while (threads > 32 && block_bytes + threads / 32 * warp_bytes > allowed) {
    threads = std::max(32, threads / 64 * 32);
  }
  return threads;
}

}  // namespace nerf_pose_refiner
