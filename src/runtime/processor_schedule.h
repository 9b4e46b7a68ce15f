// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <list>
#include <mutex>

#include "nerf_pose_refiner/cancellation_token.h"
#include "tracking/object_search.h"

namespace nerf_pose_refiner {

/// Refinement before training, on one processor: while anything is refined, trainings rest at their
/// next check for cancellation.
///
/// So that a training comes to an end beside a camera that never rests, it gets a share: when the
/// processor was busy with refinements for a time t, the next one waits for
/// t * kTrainingFraction / (1 - kTrainingFraction), at most kMaxGap_s, counted from the end of
/// the last. A gap between two images counts as well. May be used from many threads at once.
class ProcessorSchedule {
 public:
  static constexpr double kTrainingFraction =
      0.2;  ///< of the time, beside refinements without a gap
  static constexpr double kMaxGap_s = 0.2;

  /// A refinement under way, from its construction on, which may wait for a training's share.
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

  /// A training under way: its token is paused and resumed.
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
  std::list<CancellationToken> trainings_;  ///< under way, or at rest
  int refinements_ = 0;                     ///< under way
  Clock::time_point busy_since_;            ///< when `refinements_` became 1
  Clock::time_point gap_end_;               ///< until then the trainings have the processor
};

}  // namespace nerf_pose_refiner
