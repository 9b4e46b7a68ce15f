// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/host_device.h"

namespace nerf_pose_refiner {

/// A robust loss and its weight in iteratively reweighted least squares.
template <typename T>
struct RobustTerm {
  T value;   ///< rho(r), r^2 / 2 for a small residual
  T weight;  ///< rho'(r) / r, 1 for a small residual
};

/// Geman-McClure: rho = r^2 / 2 / (1 + (r / scale)^2), bounded by scale^2 / 2. Takes r^2, the sum
/// over a pixel's channels.
template <typename T>
NPR_HOST_DEVICE inline RobustTerm<T> gemanMcClure(T squared_residual, T scale) {
  const T factor = 1 / (1 + squared_residual / (scale * scale));
  return {squared_residual / 2 * factor, factor * factor};
}

}  // namespace nerf_pose_refiner
