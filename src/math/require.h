// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {

/// Checks a setting. @param name and the range are for the message: "<name> is <value>, must be
/// <range>". @throws std::invalid_argument unless it holds.
inline void require(bool holds, const std::string& name, double value, const char* range = "") {
  if (holds) return;
  const std::string must_be = *range ? std::string(", must be ") + range : "";
  throw std::invalid_argument(name + " is " + std::to_string(value) + must_be);
}

}  // namespace nerf_pose_refiner
