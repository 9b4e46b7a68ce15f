// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/aside_alignment.h"

#include <chrono>
#include <utility>

#include "concurrency/thread_priority.h"

namespace nerf_pose_refiner {

AsideAlignment::AsideAlignment(std::unique_ptr<KeyframeAligner> aligner,
                               const KeyframeAlignmentSettings& settings)
    : settings_(settings), aligner_(std::move(aligner)), thread_([this] { work(); }) {}

AsideAlignment::~AsideAlignment() {
  cancellation_.requestCancel();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void AsideAlignment::begin(const Observation& observation,
                           std::shared_ptr<const KeyframePoints> keyframe,
                           const Pose& start_T_O_C) {
  // Here, because the image may be gone when the thread comes to it.
  aligner_->observe(observation, frameWindowFor(*keyframe, observation.camera, start_T_O_C));
  keyframe_ = std::move(keyframe);
  start_T_O_C_ = start_T_O_C;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    busy_ = is_requested_ = true;
  }
  changed_.notify_all();
}

bool AsideAlignment::busy() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return busy_;
}

std::optional<Hypothesis> AsideAlignment::take() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!done_ && !error_) return std::nullopt;
  busy_ = false;
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  return std::exchange(done_, std::nullopt);
}

Hypothesis AsideAlignment::wait(const CancellationToken& cancellation) {
  constexpr std::chrono::milliseconds kTick(5);  // polled: a token does not notify anybody
  {
    std::unique_lock<std::mutex> lock(mutex_);
    while (!done_ && !error_) {
      cancellation.check();
      changed_.wait_for(lock, kTick);
    }
  }
  return *take();
}

void AsideAlignment::work() {
  yieldToOtherThreads();
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stopping_ || is_requested_; });
    if (stopping_) return;
    is_requested_ = false;
    lock.unlock();
    std::optional<Hypothesis> done;
    std::exception_ptr error;
    try {
      done = align();
    } catch (...) {
      error = std::current_exception();
    }
    lock.lock();
    done_ = done;
    error_ = error;
    changed_.notify_all();
  }
}

Hypothesis AsideAlignment::align() {
  if (keyframe_ != added_) {
    if (added_) aligner_->remove(number_);
    added_ = nullptr;
    number_ = aligner_->add(keyframe_);
    added_ = keyframe_;
  }
  return aligner_->align({{number_, start_T_O_C_}}, settings_, cancellation_).front();
}

}  // namespace nerf_pose_refiner
