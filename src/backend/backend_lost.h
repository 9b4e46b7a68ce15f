// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>

namespace nerf_pose_refiner {

/// The processor of a backend has failed for good: neither this backend nor a new one for the same
/// processor works until the process restarts.
class BackendLost : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

}  // namespace nerf_pose_refiner
