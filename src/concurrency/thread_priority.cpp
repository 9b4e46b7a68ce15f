// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "concurrency/thread_priority.h"

#include <sys/resource.h>

namespace nerf_pose_refiner {

void yieldToOtherThreads() {
  constexpr int kSteps = 4;  // each is worth a quarter of the time
  setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + kSteps);
}

}  // namespace nerf_pose_refiner
