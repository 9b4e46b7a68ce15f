// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {

/// A message that cannot be used: reported in ~status, and otherwise ignored.
class InputError : public std::invalid_argument {
 public:
  /// @param reason RefinementStatus::REASON_*.
  InputError(std::uint8_t reason, const std::string& message)
      : std::invalid_argument(message), reason_(reason) {}

  std::uint8_t reason() const { return reason_; }

 private:
  std::uint8_t reason_;
};

}  // namespace nerf_pose_refiner
