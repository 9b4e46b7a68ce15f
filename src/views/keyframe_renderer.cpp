// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/keyframe_renderer.h"

#include <chrono>
#include <utility>

#include "concurrency/thread_priority.h"

namespace nerf_pose_refiner {

KeyframeRenderer::KeyframeRenderer(std::shared_ptr<const LoadedField> field,
                                   const KeyframeSettings& settings)
    : field_(std::move(field)), settings_(settings), thread_([this] { work(); }) {}

KeyframeRenderer::~KeyframeRenderer() {
  cancellation_.requestCancel();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void KeyframeRenderer::request(const View& view) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    requested_ = view;
    busy_ = true;
  }
  changed_.notify_all();
}

bool KeyframeRenderer::busy() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return busy_;
}

std::shared_ptr<const KeyframePoints> KeyframeRenderer::take() {
  const std::lock_guard<std::mutex> lock(mutex_);
  if (!done_ && !error_) return nullptr;
  busy_ = false;
  if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
  return std::exchange(done_, nullptr);
}

std::shared_ptr<const KeyframePoints> KeyframeRenderer::wait(
    const CancellationToken& cancellation) {
  constexpr std::chrono::milliseconds kTick(5);  // polled: a token does not notify anybody
  {
    std::unique_lock<std::mutex> lock(mutex_);
    while (busy_ && !done_ && !error_) {
      cancellation.check();
      changed_.wait_for(lock, kTick);
    }
  }
  return take();
}

void KeyframeRenderer::work() {
  yieldToOtherThreads();
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stopping_ || requested_; });
    if (stopping_) return;
    const View view = *std::exchange(requested_, std::nullopt);
    lock.unlock();
    std::shared_ptr<const KeyframePoints> keyframe;
    std::exception_ptr error;
    try {
      keyframe = std::make_shared<const KeyframePoints>(
          renderKeyframe(*field_, view, settings_, cancellation_));
    } catch (...) {
      error = std::current_exception();
    }
    lock.lock();
    done_ = std::move(keyframe);
    error_ = error;
    changed_.notify_all();
  }
}

}  // namespace nerf_pose_refiner
