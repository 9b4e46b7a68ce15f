// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <condition_variable>
#include <memory>
#include <mutex>
#include <thread>

#include "nerf_pose_refiner/cancellation_token.h"
#include "views/view_bank.h"

namespace nerf_pose_refiner {

/// Renders all views of a bank, one after the other, in a thread that yields to all others: so that
/// the first searches need not. Ends early where a rendering fails; who needs that view is told.
class ViewBankFiller {
 public:
  /// @param bank of a field that threads may share.
  explicit ViewBankFiller(std::shared_ptr<ViewBank> bank);
  /// Cancels a running rendering.
  ~ViewBankFiller();

  /// While it lives, no rendering begins.
  class Pause {
   public:
    /// @param filler lives longer; null: there is nothing to pause.
    explicit Pause(ViewBankFiller* filler);
    ~Pause();
    Pause(const Pause&) = delete;
    Pause& operator=(const Pause&) = delete;

   private:
    ViewBankFiller* filler_;
  };

 private:
  void work();
  bool mayGoOn();
  void addPauses(int count);

  std::shared_ptr<ViewBank> bank_;
  CancellationToken cancellation_;

  std::mutex mutex_;  // guards what follows
  std::condition_variable changed_;
  int pauses_ = 0;
  bool is_over_ = false;

  std::thread thread_;
};

}  // namespace nerf_pose_refiner
