// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace nerf_pose_refiner {

/// Why a hypothesis is no longer optimised.
enum class HypothesisState { kLive, kBehindCamera, kOutOfImage, kIllConditioned, kNotFinite };

}  // namespace nerf_pose_refiner
