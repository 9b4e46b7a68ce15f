// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <memory>

#include "nerf_pose_refiner/engine/engine.h"

namespace nerf_pose_refiner {

/// Makes an engine for a thread: engines are not shared between threads.
using EngineFactory = std::function<std::shared_ptr<Engine>()>;

}  // namespace nerf_pose_refiner
