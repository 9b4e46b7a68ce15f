// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <functional>
#include <string>
#include <vector>

#include "backend/backend.h"
#include "backend/training.h"
#include "dataset/dataset.h"
#include "nerf_pose_refiner/registration.h"

namespace nerf_pose_refiner {

/// The views of a dataset: those that the field learns from, and those held out for its quality.
struct SplitViews {
  std::vector<PosedView> training, held_out;
};

/// One run of a trainer: steps until the time, the steps or the quality are reached. All that it is
/// given outlives it.
class TrainingRun {
 public:
  TrainingRun(Backend* backend, FieldTrainer* trainer, const RegistrationOptions& settings,
              const SplitViews& views,
              const std::function<void(const RegistrationProgress&)>& progress)
      : backend_(backend),
        trainer_(trainer),
        settings_(settings),
        views_(views),
        progress_(progress) {}

  /// @param stage of the progress. @throws Cancelled.
  void run(const char* stage, const CancellationToken& cancellation);

  /// Tells the progress, about twice a second and whenever the stage changes.
  void report(const char* stage, const std::function<Image8()>& preview = {});

 private:
  using Clock = std::chrono::steady_clock;

  Image8 preview(const CancellationToken& cancellation);

  /// Fraction of the training that is done, by steps or by time.
  double done() const;

  Backend* backend_;
  FieldTrainer* trainer_;
  const RegistrationOptions& settings_;
  const SplitViews& views_;
  const std::function<void(const RegistrationProgress&)>& progress_;
  Clock::time_point start_ = Clock::now();
  std::string last_stage_;
  double last_report_s_ = -1e9;
  double loss_ = 0, psnr_db_ = 0;
};

}  // namespace nerf_pose_refiner
