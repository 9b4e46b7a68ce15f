// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "probe.h"

#include <cuda_runtime_api.h>

namespace nerf_pose_refiner {
namespace {

__global__ void probeKernel() {}

}  // namespace

std::string whyNoKernels() {
  cudaError_t error = cudaFree(nullptr);  // makes the context
  cudaFuncAttributes attributes;
  if (error == cudaSuccess) error = cudaFuncGetAttributes(&attributes, probeKernel);
  if (error == cudaSuccess) return "";
  cudaGetLastError();
  return cudaGetErrorString(error);
}

}  // namespace nerf_pose_refiner
