// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/processor_schedule.h"

#include <algorithm>
#include <thread>

namespace nerf_pose_refiner {
namespace {

/// The time for training after refinements have used the processor for some time.
std::chrono::steady_clock::duration gapAfter(std::chrono::steady_clock::duration busy) {
  constexpr double kFraction = ProcessorSchedule::kTrainingFraction;
  const double gap_s = std::chrono::duration<double>(busy).count() * kFraction / (1 - kFraction);
  return std::chrono::duration_cast<std::chrono::steady_clock::duration>(
      std::chrono::duration<double>(std::min(gap_s, ProcessorSchedule::kMaxGap_s)));
}

}  // namespace

ProcessorSchedule::Refinement::Refinement(ProcessorSchedule* schedule,
                                          const CancellationToken& cancellation)
    : schedule_(schedule) {
  schedule_->begin(cancellation);
}

ProcessorSchedule::Refinement::~Refinement() { schedule_->end(); }

ProcessorSchedule::Training::Training(ProcessorSchedule* schedule, const CancellationToken& token)
    : schedule_(schedule) {
  std::lock_guard<std::mutex> lock(schedule_->mutex_);
  token_ = schedule_->trainings_.insert(schedule_->trainings_.end(), token);
  token.setPaused(schedule_->refinements_ > 0);
}

ProcessorSchedule::Training::~Training() {
  std::lock_guard<std::mutex> lock(schedule_->mutex_);
  token_->setPaused(false);
  schedule_->trainings_.erase(token_);
}

/// Whether a refinement must wait before it begins. While refinements overlap, no other one may
/// begin once the time that they owe to training has reached its maximum.
bool ProcessorSchedule::trainingIsDue(Clock::time_point now) const {
  if (trainings_.empty()) return false;
  if (refinements_ == 0) return now < gap_end_;
  return std::chrono::duration<double>(gapAfter(now - busy_since_)).count() >= kMaxGap_s;
}

void ProcessorSchedule::begin(const CancellationToken& cancellation) {
  std::unique_lock<std::mutex> lock(mutex_);
  // Polled, because a token cannot wake a thread.
  while (trainingIsDue(Clock::now()) && !cancellation.cancelRequested()) {
    lock.unlock();
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    lock.lock();
  }
  if (refinements_++ > 0) return;
  busy_since_ = Clock::now();
  for (const CancellationToken& training : trainings_) training.setPaused(true);
}

void ProcessorSchedule::end() {
  std::lock_guard<std::mutex> lock(mutex_);
  if (--refinements_ > 0) return;
  const Clock::time_point now = Clock::now();
  gap_end_ = now + gapAfter(now - busy_since_);
  for (const CancellationToken& training : trainings_) training.setPaused(false);
}

}  // namespace nerf_pose_refiner
