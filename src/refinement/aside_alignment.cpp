// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/aside_alignment.h"

#include <utility>

#include "concurrency/thread_priority.h"

namespace nerf_pose_refiner {

AsideAlignment::AsideAlignment(std::unique_ptr<KeyframeAligner> aligner,
                               const KeyframeAlignmentSettings& settings)
    : settings_(settings), aligner_(std::move(aligner)), worker_(yieldToOtherThreads) {}

AsideAlignment::~AsideAlignment() { cancellation_.requestCancel(); }

void AsideAlignment::begin(const Observation& observation,
                           std::shared_ptr<const KeyframePoints> keyframe,
                           const Pose& start_T_O_C) {
  // Here, because the image may be gone when the thread comes to it.
  aligner_->observe(observation, frameWindowFor(*keyframe, observation.camera, start_T_O_C));
  keyframe_ = std::move(keyframe);
  start_T_O_C_ = start_T_O_C;
  worker_.begin([this] { end_ = align(); });
}

std::optional<Hypothesis> AsideAlignment::take() {
  if (!worker_.takeEnd()) return std::nullopt;
  return end_;
}

Hypothesis AsideAlignment::wait(const CancellationToken& cancellation) {
  worker_.wait(cancellation);
  return end_;
}

Hypothesis AsideAlignment::align() {
  if (keyframe_ != added_) {
    if (added_) aligner_->remove(number_);
    added_ = nullptr;
    number_ = aligner_->add(keyframe_);
    added_ = keyframe_;
  }
  return aligner_->align({{number_, start_T_O_C_}}, settings_, cancellation_).front();
}

}  // namespace nerf_pose_refiner
