// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdlib>
#include <stdexcept>
#include <string>

/// A number on the command line. @throws std::runtime_error if it is none.
inline double numberOf(const char* text) {
  char* end = nullptr;
  const double number = std::strtod(text, &end);
  if (end == text || *end) throw std::runtime_error("'" + std::string(text) + "' is not a number");
  return number;
}
