// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>

#include "backend/keyframe_aligner.h"
#include "concurrency/worker.h"

namespace nerf_pose_refiner {

/// Aligns a keyframe with an image in a thread of its own, so that tracking does not wait for it:
/// what is begun in one image is there for one of the next. One thread may call it.
class AsideAlignment {
 public:
  /// @param aligner of its own.
  AsideAlignment(std::unique_ptr<KeyframeAligner> aligner,
                 const KeyframeAlignmentSettings& settings);
  /// Cancels what is under way.
  ~AsideAlignment();

  /// Requires `!busy()`. @param observation is not needed any more afterwards.
  /// @param start_T_O_C [model units]. @throws as KeyframeAligner::observe; nothing is begun then.
  void begin(const Observation& observation, std::shared_ptr<const KeyframePoints> keyframe,
             const Pose& start_T_O_C);
  /// Whether something was begun whose result has not been taken yet.
  bool busy() const { return worker_.busy(); }
  /// Takes the result. Nothing: it is not there yet, or nothing was begun.
  /// @throws what the alignment threw; it is then over.
  std::optional<Hypothesis> take();
  /// Waits for the result of what was begun. @throws Cancelled, and as `take`.
  Hypothesis wait(const CancellationToken& cancellation);

 private:
  Hypothesis align();

  KeyframeAlignmentSettings settings_;
  CancellationToken cancellation_;

  // Of the worker while it is busy, else of the caller.
  std::unique_ptr<KeyframeAligner> aligner_;
  std::shared_ptr<const KeyframePoints> keyframe_, added_;
  int number_ = 0;  // of the keyframe that was added
  Pose start_T_O_C_;
  Hypothesis end_;

  Worker worker_;
};

}  // namespace nerf_pose_refiner
