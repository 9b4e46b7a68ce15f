// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/make_backend.h"

#include <stdexcept>

#include "backend/gpu_memory.h"

namespace nerf_pose_refiner {

void BackendChoice::validate() const {
  if (backend != "auto" && backend != "cpu" && backend != "cuda") {
    throw std::invalid_argument("no backend is called '" + backend +
                                "'; there are auto, cpu, cuda");
  }
  if (device < 0) {
    throw std::invalid_argument("BackendChoice::device is " + std::to_string(device) +
                                ", must be 0 or more");
  }
}

#ifndef NPR_HAVE_CUDA
std::string whyNoCuda(int) { return "this package was built without CUDA"; }

std::optional<GpuMemory> gpuMemory(int) { return std::nullopt; }

std::unique_ptr<Backend> makeCudaBackend(const BackendChoice& choice) {
  throw std::runtime_error("no CUDA backend: " + whyNoCuda(choice.device));
}
#endif

std::unique_ptr<Backend> makeBackend(const BackendChoice& choice) {
  choice.validate();
  if (choice.backend == "cuda" || (choice.backend == "auto" && whyNoCuda(choice.device).empty())) {
    return makeCudaBackend(choice);
  }
  return makeCpuBackend(choice.threads, choice.instruction_set);
}

}  // namespace nerf_pose_refiner
