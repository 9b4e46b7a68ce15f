// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "concurrency/thread_priority.h"

#include <sys/resource.h>

namespace nerf_pose_refiner {

void yieldToOtherThreads() {
  constexpr int kNiceness = 10;
  setpriority(PRIO_PROCESS, 0, kNiceness);
}

}  // namespace nerf_pose_refiner
