// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/keyframe_renderer.h"

#include <chrono>
#include <utility>

#include "concurrency/thread_priority.h"

namespace nerf_pose_refiner {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kRendererTick(5);  // polled: a token does not notify anybody

}  // namespace

KeyframeRenderer::KeyframeRenderer(std::shared_ptr<const LoadedField> field,
                                   const KeyframeSettings& settings, Done done)
    : field_(std::move(field)),
      settings_(settings),
      call_done_(std::move(done)),
      thread_([this] { work(); }) {}

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
  {
    std::unique_lock<std::mutex> lock(mutex_);
    while (busy_ && !done_ && !error_) {
      cancellation.check();
      changed_.wait_for(lock, kRendererTick);
    }
  }
  return take();
}

void KeyframeRenderer::doAside(AsideStep step) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    aside_ = std::move(step);
    is_urgent_ = is_paused_ = false;
  }
  changed_.notify_all();
}

bool KeyframeRenderer::isAsideBusy() const {
  const std::lock_guard<std::mutex> lock(mutex_);
  return static_cast<bool>(aside_);
}

void KeyframeRenderer::waitForAside(const CancellationToken& cancellation) {
  goOnAside();
  std::unique_lock<std::mutex> lock(mutex_);
  while (aside_) {
    cancellation.check();
    changed_.wait_for(lock, kRendererTick);
  }
  if (aside_error_) std::rethrow_exception(std::exchange(aside_error_, nullptr));
}

void KeyframeRenderer::pauseAside() {
  std::unique_lock<std::mutex> lock(mutex_);
  is_paused_ = true;
  changed_.wait(lock, [this] { return !is_stepping_; });
}

void KeyframeRenderer::goOnAside(bool is_urgent) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_urgent_ = is_urgent;
    is_paused_ = false;
  }
  changed_.notify_all();
}

void KeyframeRenderer::endAside() {
  std::unique_lock<std::mutex> lock(mutex_);
  aside_ = nullptr;
  changed_.wait(lock, [this] { return !is_stepping_; });
  aside_error_ = nullptr;
}

void KeyframeRenderer::work() {
  yieldToOtherThreads();
  std::unique_lock<std::mutex> lock(mutex_);
  while (true) {
    changed_.wait(lock, [this] { return stopping_ || requested_ || (aside_ && !is_paused_); });
    if (stopping_) return;
    const Clock::time_point begin = Clock::now();
    if (isAsideNext()) {
      stepAside(&lock);
      aside_due_ -= Clock::now() - begin;
    } else {
      renderNext(&lock);
      aside_due_ = Clock::now() - begin;
    }
    changed_.notify_all();
  }
}

bool KeyframeRenderer::isAsideNext() const {
  if (!aside_ || is_paused_) return false;
  return !requested_ || (is_urgent_ && aside_due_ > Seconds::zero());
}

void KeyframeRenderer::renderNext(std::unique_lock<std::mutex>* lock) {
  const View view = *std::exchange(requested_, std::nullopt);
  lock->unlock();
  std::shared_ptr<const KeyframePoints> keyframe;
  std::exception_ptr error;
  try {
    keyframe = std::make_shared<const KeyframePoints>(
        renderKeyframe(*field_, view, settings_, cancellation_));
    if (call_done_) call_done_(keyframe);
  } catch (...) {
    error = std::current_exception();
  }
  lock->lock();
  if (!error) done_ = std::move(keyframe);
  error_ = error;
}

void KeyframeRenderer::stepAside(std::unique_lock<std::mutex>* lock) {
  const AsideStep step = aside_;
  is_stepping_ = true;
  lock->unlock();
  bool goes_on = false;
  std::exception_ptr error;
  try {
    goes_on = step(cancellation_);
  } catch (...) {
    error = std::current_exception();
  }
  lock->lock();
  is_stepping_ = false;
  if (error) aside_error_ = error;
  if (!goes_on) aside_ = nullptr;
}

}  // namespace nerf_pose_refiner
