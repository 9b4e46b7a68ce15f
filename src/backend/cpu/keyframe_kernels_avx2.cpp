// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Compiled with -mavx2 -mfma; called only on processors that have them.
#include "backend/cpu/keyframe_kernels.inl"

namespace nerf_pose_refiner {

const KeyframeKernels* avx2KeyframeKernels() { return &kKernels; }

}  // namespace nerf_pose_refiner
