// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <exception>
#include <functional>
#include <mutex>
#include <thread>

#include "nerf_pose_refiner/cancellation_token.h"

namespace nerf_pose_refiner {

/// A thread that does one job after the other for the thread that owns it. From `begin` until the
/// job's end has been noted, what the job uses belongs to it.
class Worker {
 public:
  using Job = std::function<void()>;

  /// @param first called in the thread before any job, as `yieldToOtherThreads` is; it must not
  /// throw.
  explicit Worker(const Job& first = [] {});
  /// Waits for the job that is under way; one that has not started yet is not done.
  ~Worker();

  /// Requires `!busy()`.
  void begin(Job job);
  /// Whether there is a job whose end has not been noted yet, by one of the following.
  bool busy() const;
  /// Notes the end of a job. @return false: it has not ended yet, or there is none.
  /// @throws what the job threw.
  bool takeEnd();
  /// Waits for the end of the job that was begun, if there is one. @throws Cancelled: the job goes
  /// on; and what it threw.
  void wait(const CancellationToken& cancellation);

 private:
  void work(const Job& first);

  mutable std::mutex mutex_;  ///< guards all below, but for the thread
  std::condition_variable changed_;
  Job job_;  ///< to be done next
  bool busy_ = false, has_ended_ = false, stopping_ = false;
  std::exception_ptr error_;

  std::thread thread_;
};

}  // namespace nerf_pose_refiner
