// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "concurrency/thread_priority.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>

namespace nerf_pose_refiner {
namespace {

/// To so much below the process's own. @param steps each is worth a fifth of the time.
void lowerPriority(int steps) {
  const int of_process = getpriority(PRIO_PROCESS, static_cast<id_t>(getpid()));
  setpriority(PRIO_PROCESS, 0, std::max(getpriority(PRIO_PROCESS, 0), of_process + steps));
}

}  // namespace

void yieldToOtherThreads() { lowerPriority(4); }

void yieldWhollyToOtherThreads() { lowerPriority(16); }

}  // namespace nerf_pose_refiner
