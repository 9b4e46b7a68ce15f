// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/refiner_process.h"

#include <mutex>

namespace nerf_pose_refiner {

std::shared_ptr<RefinerProcess> RefinerProcess::ofThisProcess() {
  static std::mutex mutex;  // guards `known`
  static std::weak_ptr<RefinerProcess> known;
  std::lock_guard<std::mutex> lock(mutex);
  if (std::shared_ptr<RefinerProcess> process = known.lock()) return process;
  const auto process = std::make_shared<RefinerProcess>();
  known = process;
  return process;
}

}  // namespace nerf_pose_refiner
