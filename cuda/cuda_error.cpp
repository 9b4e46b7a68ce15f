// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_error.h"

#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {

void checkCuda(cudaError_t error, const char* call, const char* file, int line) {
  if (error == cudaSuccess) return;
  cudaGetLastError();
  const std::string path = file;
  const std::string name = path.substr(path.find_last_of('/') + 1);
  throw std::runtime_error("CUDA: " + std::string(cudaGetErrorString(error)) + " (" +
                           cudaGetErrorName(error) + ") at " + name + ":" + std::to_string(line) +
                           ": " + call);
}

}  // namespace nerf_pose_refiner
