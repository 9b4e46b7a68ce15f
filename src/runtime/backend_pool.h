// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>

#include "backend/make_backend.h"
#include "runtime/processor_schedule.h"
#include "tracking/object_search.h"

namespace nerf_pose_refiner {

/// Creates a backend for the calling thread alone.
using BackendFactory = std::function<std::shared_ptr<Backend>()>;

/// Finds the schedule of a backend's processor. Called by the thread that trains, because looking
/// for a GPU takes time.
using ScheduleFactory = std::function<std::shared_ptr<ProcessorSchedule>()>;

/// The backends and schedules of a process. Thread-safe.
class BackendPool {
 public:
  /// The backend that all refinements with this choice share (@see SharedBackend). The first call
  /// creates it, which takes time for a GPU; it is destroyed with the last of its users.
  /// @throws as makeBackend.
  std::shared_ptr<Backend> shared(const BackendChoice& choice);

  /// The schedule of the chosen processor: the cores of this computer, or one GPU. The first search
  /// for a GPU takes time.
  std::shared_ptr<ProcessorSchedule> scheduleOf(const BackendChoice& choice);

  /// The shared backend; trainings are paused during its users' turns. @throws as makeBackend.
  SearchProcessor searchProcessor(const BackendChoice& choice);

 private:
  std::mutex mutex_;  ///< guards all below
  std::map<std::string, std::weak_ptr<Backend>> backends_;
  std::map<std::string, std::shared_ptr<ProcessorSchedule>> schedules_;
};

}  // namespace nerf_pose_refiner
