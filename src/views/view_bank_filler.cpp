// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/view_bank_filler.h"

#include <exception>
#include <utility>

#include "concurrency/thread_priority.h"

namespace nerf_pose_refiner {

ViewBankFiller::ViewBankFiller(std::shared_ptr<ViewBank> bank)
    : bank_(std::move(bank)), thread_([this] { work(); }) {}

ViewBankFiller::~ViewBankFiller() {
  cancellation_.requestCancel();
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    is_over_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void ViewBankFiller::work() {
  yieldWhollyToOtherThreads();
  try {
    for (int number = 0; number < bank_->size() && mayGoOn(); ++number) {
      bank_->make({number}, cancellation_);
    }
  } catch (const std::exception&) {
    // Cancelled, or what a search that needs the view meets and reports.
  }
}

/// Waits for the end of pauses. @return false: it is over.
bool ViewBankFiller::mayGoOn() {
  std::unique_lock<std::mutex> lock(mutex_);
  changed_.wait(lock, [this] { return is_over_ || pauses_ == 0; });
  return !is_over_;
}

void ViewBankFiller::addPauses(int count) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    pauses_ += count;
  }
  changed_.notify_all();
}

ViewBankFiller::Pause::Pause(ViewBankFiller* filler) : filler_(filler) {
  if (filler_ != nullptr) filler_->addPauses(1);
}

ViewBankFiller::Pause::~Pause() {
  if (filler_ != nullptr) filler_->addPauses(-1);
}

}  // namespace nerf_pose_refiner
