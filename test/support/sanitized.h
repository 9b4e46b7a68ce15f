// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace nerf_pose_refiner {

/// Whether the program is built with a sanitizer: it has an allocator of its own, which reserves
/// terabytes of addresses and keeps what is freed.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr bool kSanitized = true;
#else
constexpr bool kSanitized = false;
#endif

}  // namespace nerf_pose_refiner
