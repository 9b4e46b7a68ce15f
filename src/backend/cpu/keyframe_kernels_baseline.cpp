// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/keyframe_kernels.inl"

namespace nerf_pose_refiner {

const KeyframeKernels* baselineKeyframeKernels() { return &kKernels; }

}  // namespace nerf_pose_refiner
