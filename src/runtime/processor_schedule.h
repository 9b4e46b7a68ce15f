// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <list>
#include <mutex>

#include "nerf_pose_refiner/cancellation_token.h"
#include "tracking/object_search.h"

namespace nerf_pose_refiner {

/// Gives refinement priority over training on one processor: while a refinement runs, trainings
/// pause at their next check for cancellation.
///
/// A training gets a minimum share of the time, so that it ends even beside a camera that never
/// pauses: after refinements have used the processor for a time t, the next one waits until
/// t * kTrainingFraction / (1 - kTrainingFraction), at most kMaxGap_s, has passed since the end of
/// the last. A gap between two images counts towards this time. Thread-safe.
class ProcessorSchedule {
 public:
  /// Fraction of the time for training, beside refinements without a gap.
  static constexpr double kTrainingFraction = 0.2;
  static constexpr double kMaxGap_s = 0.2;

  /// A running refinement. Its construction may wait until training has had its share.
  class Refinement : public ProcessorTurn {
   public:
    /// @param cancellation ends the waiting.
    Refinement(ProcessorSchedule* schedule, const CancellationToken& cancellation);
    ~Refinement() override;
    Refinement(const Refinement&) = delete;
    Refinement& operator=(const Refinement&) = delete;

   private:
    ProcessorSchedule* schedule_;
  };

  /// A running training, which is paused and resumed through its token.
  class Training {
   public:
    Training(ProcessorSchedule* schedule, const CancellationToken& token);
    ~Training();
    Training(const Training&) = delete;
    Training& operator=(const Training&) = delete;

   private:
    ProcessorSchedule* schedule_;
    std::list<CancellationToken>::iterator token_;
  };

 private:
  using Clock = std::chrono::steady_clock;

  void begin(const CancellationToken& cancellation);
  void end();
  bool trainingIsDue(Clock::time_point now) const;

  std::mutex mutex_;                        ///< guards all below
  std::list<CancellationToken> trainings_;  ///< running or paused
  int refinements_ = 0;                     ///< number of running ones
  Clock::time_point busy_since_;            ///< when `refinements_` became 1
  Clock::time_point gap_end_;               ///< until then the processor is for training
};

}  // namespace nerf_pose_refiner
