// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "backend/make_backend.h"
#include "runtime/processor_schedule.h"

namespace nerf_pose_refiner {

/// Makes an backend for a thread: backends are not shared between threads.
using BackendFactory = std::function<std::shared_ptr<Backend>()>;

/// Finds who may use an backend's processor, by the thread that works: to look for a GPU takes
/// long.
using ScheduleFactory = std::function<std::shared_ptr<ProcessorSchedule>()>;

/// Engines and schedules of a process. May be used from many threads at once.
class BackendPool {
 public:
  /// The backend with which all refinements of this choice are made (@see SharedBackend); made with
  /// the first call, which takes long for a GPU, and gone with the last of its users.
  /// @throws as makeBackend.
  std::shared_ptr<Backend> shared(const BackendChoice& choice);

  /// Who may use the processor of this choice: the cores of this computer, or one GPU. The first
  /// look for a GPU takes long.
  std::shared_ptr<ProcessorSchedule> scheduleOf(const BackendChoice& choice);

 private:
  std::mutex mutex_;  ///< guards all below
  std::map<std::string, std::weak_ptr<Backend>> backends_;
  std::map<std::string, std::shared_ptr<ProcessorSchedule>> schedules_;
};

}  // namespace nerf_pose_refiner
