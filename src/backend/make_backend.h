// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "backend/backend.h"
#include "backend/keyframe_aligner.h"

namespace nerf_pose_refiner {

/// The CPU backend. @param threads 0: all cores. @param instruction_set "auto", "baseline", "avx2".
/// @throws std::invalid_argument for an unknown instruction set, std::runtime_error for one that
/// this processor does not have.
std::unique_ptr<Backend> makeCpuBackend(int threads = 0,
                                        const std::string& instruction_set = "auto");

/// What aligns keyframes on the CPU, whatever processor renders. @param threads 0: all cores.
/// @throws as makeCpuBackend.
std::unique_ptr<KeyframeAligner> makeCpuKeyframeAligner(
    int threads = 0, const std::string& instruction_set = "auto");

/// Which processor a backend works on, and how much of it it takes.
struct BackendChoice {
  std::string backend = "auto";          ///< "auto": cuda where that works, else cpu; "cpu", "cuda"
  int threads = 0;                       ///< of the CPU backend; 0: all cores
  std::string instruction_set = "auto";  ///< of the CPU backend: "auto", "baseline", "avx2"
  int device = 0;                        ///< of the CUDA backend: number of the GPU

  /// @throws std::invalid_argument naming what is wrong.
  void validate() const;
};

/// Why makeCudaBackend would fail: the package was built without CUDA or for other devices, there
/// is no such device, it is too old or has no memory left, or an error of this process has made it
/// unusable (BackendLost). Empty: it works.
std::string whyNoCuda(int device = 0);

/// A backend on a CUDA device. `load`, `render` and `read` wait; `align`, `optimise` and the
/// trainer do every few steps, so that cancellation is prompt; the rest only enqueues.
/// @param choice its backend is ignored.
/// @throws std::runtime_error saying what whyNoCuda says.
std::unique_ptr<Backend> makeCudaBackend(const BackendChoice& choice = {});

/// The backend that was chosen. @throws std::invalid_argument for a choice that makes no sense,
/// std::runtime_error if that backend cannot run here.
std::unique_ptr<Backend> makeBackend(const BackendChoice& choice);

}  // namespace nerf_pose_refiner
