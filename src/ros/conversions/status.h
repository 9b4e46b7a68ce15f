// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/RefinementStatus.h>

#include <cstdint>

#include "runtime/object_store.h"

namespace nerf_pose_refiner {

/// RefinementStatus::REASON_MODEL_*.
inline std::uint8_t reasonOf(const ModelError& error) {
  return error.reason() == ModelError::Reason::kNoScale ? RefinementStatus::REASON_MODEL_NO_SCALE
                                                        : RefinementStatus::REASON_MODEL_UNREADABLE;
}

}  // namespace nerf_pose_refiner
