// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "concurrency/worker.h"

#include <chrono>
#include <utility>

namespace nerf_pose_refiner {

Worker::Worker(const Job& first) : thread_([this, first] { work(first); }) {}

Worker::~Worker() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void Worker::begin(Job job) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    job_ = std::move(job);
    busy_ = true;
  }
  changed_.notify_all();
}

bool Worker::busy() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return busy_;
}

bool Worker::takeEnd() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!has_ended_) return false;
  busy_ = has_ended_ = false;
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  return true;
}

void Worker::wait(const CancellationToken& cancellation) {
  constexpr std::chrono::milliseconds kTick(5);  // polled: a token does not notify anybody
  while (busy() && !takeEnd()) {
    cancellation.check();  // not under the lock: it blocks while the operation is paused
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait_for(lock, kTick, [this] { return has_ended_; });
  }
}

void Worker::work(const Job& first) {
  first();
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stopping_ || job_; });
    if (stopping_) return;
    Job job = std::exchange(job_, nullptr);
    lock.unlock();
    std::exception_ptr error;
    try {
      job();
    } catch (...) {
      error = std::current_exception();
    }
    job = nullptr;  // what it holds goes before anybody hears of its end
    lock.lock();
    error_ = error;
    has_ended_ = true;
    changed_.notify_all();
  }
}

}  // namespace nerf_pose_refiner
