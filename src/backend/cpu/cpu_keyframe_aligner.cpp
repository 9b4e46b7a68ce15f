// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_keyframe_aligner.h"

#include <utility>

#include "backend/make_backend.h"
#include "concurrency/parallel.h"

namespace nerf_pose_refiner {

std::unique_ptr<KeyframeAligner> makeCpuKeyframeAligner(int threads,
                                                        const std::string& instruction_set) {
  return std::make_unique<CpuKeyframeAligner>(selectKeyframeKernels(instruction_set),
                                              threadCount(threads), makeCpuFrames());
}

int CpuKeyframeAligner::add(std::shared_ptr<const KeyframePoints> keyframe) {
  keyframes_.emplace(next_, std::move(keyframe));
  return next_++;
}

void CpuKeyframeAligner::remove(int keyframe) { keyframes_.erase(keyframe); }

void CpuKeyframeAligner::observe(const Observation& observation, const FrameWindow& window) {
  frame_.look(observation, window);
}

std::vector<Hypothesis> CpuKeyframeAligner::align(const std::vector<KeyframeStart>& starts,
                                                  const KeyframeAlignmentSettings& settings,
                                                  const CancellationToken& cancellation) {
  std::vector<Hypothesis> found(starts.size());
  parallelFor(threads_, static_cast<int>(starts.size()), [&](int i) {
    cancellation.check();
    const KeyframeStart& start = starts[i];
    found[i] = workspaces_.borrow().get()->align(frame_, *keyframes_.at(start.keyframe),
                                                 start.T_O_C, settings);
  });
  return found;
}

}  // namespace nerf_pose_refiner
