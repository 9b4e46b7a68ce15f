// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/backend_pool.h"

#include "runtime/shared_backend.h"

namespace nerf_pose_refiner {
namespace {

/// Two choices with the same name use the same processor.
std::string processorOf(const BackendChoice& choice) {
  const bool on_gpu =
      choice.backend == "cuda" || (choice.backend == "auto" && whyNoCuda(choice.device).empty());
  return on_gpu ? "cuda " + std::to_string(choice.device) : "cpu";
}

}  // namespace

std::shared_ptr<Backend> BackendPool::shared(const BackendChoice& choice) {
  const std::string key = processorOf(choice) + ", " + std::to_string(choice.threads) +
                          " threads, " + choice.instruction_set;
  std::lock_guard<std::mutex> lock(mutex_);
  std::weak_ptr<Backend>& known = backends_[key];
  if (std::shared_ptr<Backend> backend = known.lock()) return backend;
  const auto backend = std::make_shared<SharedBackend>(makeBackend(choice));
  known = backend;
  return backend;
}

std::shared_ptr<ProcessorSchedule> BackendPool::scheduleOf(const BackendChoice& choice) {
  const std::string key = processorOf(choice);
  std::lock_guard<std::mutex> lock(mutex_);
  std::shared_ptr<ProcessorSchedule>& schedule = schedules_[key];
  if (!schedule) schedule = std::make_shared<ProcessorSchedule>();
  return schedule;
}

SearchProcessor BackendPool::searchProcessor(const BackendChoice& choice) {
  const auto take_turn = [schedule = scheduleOf(choice)](const CancellationToken& cancellation) {
    return std::make_unique<ProcessorSchedule::Refinement>(schedule.get(), cancellation);
  };
  return {shared(choice), take_turn};
}

}  // namespace nerf_pose_refiner
