// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "concurrency/thread_priority.h"

#include <sys/resource.h>

namespace nerf_pose_refiner {
namespace {

/// @param steps each is worth a fifth of the time.
void lowerPriority(int steps) {
  setpriority(PRIO_PROCESS, 0, getpriority(PRIO_PROCESS, 0) + steps);
}

}  // namespace

void yieldToOtherThreads() { lowerPriority(4); }

void yieldWhollyToOtherThreads() { lowerPriority(16); }

}  // namespace nerf_pose_refiner
