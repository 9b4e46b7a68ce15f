// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <string>

namespace nerf_pose_refiner {

/// Renders objects, learns them and searches for their poses on one processor. Any number of
/// threads and of objects may share a backend.
class Backend;

/// The processor that a backend uses.
struct BackendInfo {
  std::string name;              ///< "cpu" or "cuda"
  std::string description;       ///< for logs: processor, instruction set, threads or memory
  std::size_t memory_bytes = 0;  ///< the processor's own memory; 0: it uses the host's
  int threads = 0;               ///< of the CPU backend; 0: work on the host takes all cores
  int searches_at_once = 1;      ///< number of concurrent inversions that use the processor fully
  bool warms_up = false;         ///< the first calls allocate memory and take longer
  bool scans_fast = false;       ///< templates in an image are found in hundredths of a second
};

/// @param processor "cpu", "cuda", or "auto": CUDA where it works, else the CPU.
/// @param threads number of threads of the CPU backend; 0: one for each core.
/// @param device number of the GPU, from 0.
/// @throws std::invalid_argument for an unknown processor, std::runtime_error saying why CUDA does
/// not work here.
///
/// A GPU that fails for good (its driver has lost the process' context) stays lost until the
/// process ends: every call of its backend throws std::runtime_error from then on, and
/// makeBackend("auto") gives one of the CPU.
std::shared_ptr<Backend> makeBackend(const std::string& processor = "auto", int threads = 0,
                                     int device = 0);

/// The processor of a backend.
BackendInfo backendInfo(const Backend& backend);

}  // namespace nerf_pose_refiner
