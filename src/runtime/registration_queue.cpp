// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/registration_queue.h"

#include <algorithm>
#include <chrono>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <thread>
#include <utility>

#include "concurrency/seconds_since.h"
#include "image/colour.h"
#include "runtime/heap_memory.h"

namespace nerf_pose_refiner {
namespace {

using Clock = std::chrono::steady_clock;

constexpr double kPreviewInterval_s = 5;
constexpr double kPreviewFraction = 0.05;  // of the training time, at most

std::vector<std::uint8_t> toJpeg(Image8 rgb) {
  cv::Mat bgr;
  cv::cvtColor(cv::Mat(rgb.height, rgb.width, CV_8UC3, rgb.values.data()), bgr, cv::COLOR_RGB2BGR);
  std::vector<std::uint8_t> jpeg;
  cv::imencode(".jpg", bgr, jpeg);
  return jpeg;
}

/// Makes previews, and limits how often.
class PreviewRhythm {
 public:
  bool isDue() const { return secondsSince(start_) >= next_s_; }
  std::vector<std::uint8_t> make(const RegistrationProgress& progress) {
    const Clock::time_point before = Clock::now();
    std::vector<std::uint8_t> jpeg = toJpeg(progress.preview());
    next_s_ = secondsSince(start_) +
              std::max(kPreviewInterval_s, secondsSince(before) / kPreviewFraction);
    return jpeg;
  }

 private:
  Clock::time_point start_ = Clock::now();
  double next_s_ = 0;
};

std::string describe(const std::string& name, const RegistrationProgress& progress) {
  if (progress.stage.empty()) return "'" + name + "' is being registered (reading photos)";
  return "'" + name + "' is being registered (" + progress.stage + ", step " +
         std::to_string(progress.step) + " of " + std::to_string(progress.steps) + ", " +
         std::to_string(static_cast<int>(progress.seconds_left + 0.5)) + " s left)";
}

}  // namespace

/// The running job. The queue's mutex guards all but `queue`, `cancellation` and `thread`.
struct RegistrationQueue::Running {
  RegistrationQueue* queue;
  std::string name, key;
  CancellationToken cancellation;
  std::condition_variable changed;
  std::list<Listener> listeners;  ///< one for each caller that waits
  std::uint64_t updates = 0;
  RegistrationUpdate update;
  bool done = false;
  RegisteredObject result;
  std::exception_ptr error;
  std::thread thread;
};

bool RegistrationQueue::previewIsWanted(Running* running) {
  std::lock_guard<std::mutex> lock(running->queue->mutex_);
  return std::any_of(running->listeners.begin(), running->listeners.end(),
                     [](const Listener& l) { return l.wants_preview && l.wants_preview(); });
}

void RegistrationQueue::work(Running* running, const Job& job) {
  PreviewRhythm rhythm;
  const auto progress = [&](const RegistrationProgress& now) {
    std::vector<std::uint8_t> jpeg;
    if (now.preview && rhythm.isDue() && previewIsWanted(running)) jpeg = rhythm.make(now);
    std::lock_guard<std::mutex> lock(running->queue->mutex_);
    running->update.progress = now;
    running->update.progress.preview = nullptr;  // valid only during this call
    if (!jpeg.empty()) running->update.preview_jpeg = std::move(jpeg);
    ++running->updates;
    running->changed.notify_all();
  };
  RegisteredObject result;
  std::exception_ptr error;
  try {
    result = job.work(progress, running->cancellation);
  } catch (...) {
    error = std::current_exception();
  }
  returnFreedMemory();
  std::lock_guard<std::mutex> lock(running->queue->mutex_);
  running->result = std::move(result);
  running->error = error;
  running->done = true;
  running->changed.notify_all();
}

/// The running job, with one more listener. Called with mutex_ held.
std::shared_ptr<RegistrationQueue::Running> RegistrationQueue::join(const Job& job,
                                                                    const Listener& listener) {
  if (running_ && (running_->key != job.key || running_->cancellation.cancelRequested())) {
    throw RegistrationBusy(describe(running_->name, running_->update.progress));
  }
  if (!running_) {
    const auto running = std::make_shared<Running>();
    running->queue = this;
    running->name = job.name;
    running->key = job.key;
    // If there are no more threads, this throws, and nothing runs.
    running->thread = std::thread([running = running.get(), job] { work(running, job); });
    running_ = running;
  }
  running_->listeners.push_front(listener);
  return running_;
}

RegisteredObject RegistrationQueue::run(const Job& job, const Listener& listener,
                                        const CancellationToken& cancellation) {
  std::unique_lock<std::mutex> lock(mutex_);
  const std::shared_ptr<Running> running = join(job, listener);
  const auto own = running->listeners.begin();
  std::uint64_t seen = 0;
  while (!running->done && !cancellation.cancelRequested()) {
    // Polled, because a token does not notify anybody.
    running->changed.wait_for(lock, std::chrono::milliseconds(20));
    if (running->updates == seen) continue;
    seen = running->updates;
    const RegistrationUpdate update = running->update;
    lock.unlock();
    if (listener.progress) listener.progress(update);
    lock.lock();
  }
  running->listeners.erase(own);
  if (running->listeners
          .empty()) {  // the last caller cancels the job; no other can begin before it has ended
    running->cancellation.requestCancel();
    running->changed.wait(lock, [&] { return running->done; });
    running_.reset();
    lock.unlock();
    running->thread.join();
    lock.lock();
  }
  if (cancellation.cancelRequested() && !running->done) throw Cancelled();
  if (running->error) std::rethrow_exception(running->error);
  return running->result;
}

}  // namespace nerf_pose_refiner
