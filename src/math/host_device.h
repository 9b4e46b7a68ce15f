// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

/// Marks a function that is compiled for the CPU and, by a CUDA compiler, for the GPU too.
#ifdef __CUDACC__
#define NPR_HOST_DEVICE __host__ __device__
#else
#define NPR_HOST_DEVICE
#endif
