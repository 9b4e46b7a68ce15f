// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_error.h"

#include <mutex>
#include <stdexcept>
#include <string>

#include "backend/backend_lost.h"

namespace nerf_pose_refiner {
namespace {

std::mutex sticky_mutex;
std::string sticky_text;  // guarded by sticky_mutex

}  // namespace

bool isSticky(cudaError_t error) {
  switch (error) {
    case cudaErrorAssert:
    case cudaErrorECCUncorrectable:
    case cudaErrorExternalDevice:
    case cudaErrorHardwareStackError:
    case cudaErrorIllegalAddress:
    case cudaErrorIllegalInstruction:
    case cudaErrorInvalidAddressSpace:
    case cudaErrorInvalidPc:
    case cudaErrorLaunchFailure:
    case cudaErrorLaunchTimeout:
    case cudaErrorMisalignedAddress:
      return true;
    default:
      return false;
  }
}

std::string stickyError() {
  std::lock_guard<std::mutex> lock(sticky_mutex);
  return sticky_text;
}

void checkCuda(cudaError_t error, const char* call, const char* file, int line) {
  if (error == cudaSuccess) return;
  cudaGetLastError();
  const std::string path = file;
  const std::string name = path.substr(path.find_last_of('/') + 1);
  const std::string text = "CUDA: " + std::string(cudaGetErrorString(error)) + " (" +
                           cudaGetErrorName(error) + ") at " + name + ":" + std::to_string(line) +
                           ": " + call;
  if (!isSticky(error)) throw std::runtime_error(text);
  {
    std::lock_guard<std::mutex> lock(sticky_mutex);
    if (sticky_text.empty()) sticky_text = text;
  }
  throw BackendLost(text + "; CUDA works again when the process is restarted");
}

}  // namespace nerf_pose_refiner
