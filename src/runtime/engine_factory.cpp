// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/engine_factory.h"

#include "runtime/shared_engine.h"

namespace nerf_pose_refiner {
namespace {

/// Two choices with one name mean the same processor.
std::string processorOf(const EngineChoice& choice) {
  const bool on_gpu =
      choice.backend == "cuda" || (choice.backend == "auto" && whyNoCuda(choice.device).empty());
  return on_gpu ? "cuda " + std::to_string(choice.device) : "cpu";
}

}  // namespace

std::shared_ptr<Engine> EnginePool::shared(const EngineChoice& choice) {
  const std::string key = processorOf(choice) + ", " + std::to_string(choice.threads) +
                          " threads, " + choice.instruction_set;
  std::lock_guard<std::mutex> lock(mutex_);
  std::weak_ptr<Engine>& known = engines_[key];
  if (std::shared_ptr<Engine> engine = known.lock()) return engine;
  const auto engine = std::make_shared<SharedEngine>(makeEngine(choice));
  known = engine;
  return engine;
}

std::shared_ptr<ProcessorSchedule> EnginePool::scheduleOf(const EngineChoice& choice) {
  const std::string key = processorOf(choice);
  std::lock_guard<std::mutex> lock(mutex_);
  std::shared_ptr<ProcessorSchedule>& schedule = schedules_[key];
  if (!schedule) schedule = std::make_shared<ProcessorSchedule>();
  return schedule;
}

}  // namespace nerf_pose_refiner
