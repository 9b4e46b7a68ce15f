// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <utility>
#include <vector>

#include "backend/common/scratch_pool.h"
#include "backend/cpu/cpu_frame.h"
#include "backend/cpu/start_aligner.h"
#include "backend/keyframe_aligner.h"

namespace nerf_pose_refiner {

/// Aligns keyframes on the CPU: starts side by side, one thread each.
class CpuKeyframeAligner final : public KeyframeAligner {
 public:
  /// @param frames of the backend.
  CpuKeyframeAligner(const KeyframeKernels& kernels, int threads, std::shared_ptr<CpuFrames> frames)
      : threads_(threads),
        frame_(std::move(frames)),
        workspaces_([&kernels] { return std::make_unique<StartAligner>(kernels); }) {}

  int add(std::shared_ptr<const KeyframePoints> keyframe) override;
  void remove(int keyframe) override;
  void observe(const Observation& observation, const FrameWindow& window) override;
  std::vector<Hypothesis> align(const std::vector<KeyframeStart>& starts,
                                const KeyframeAlignmentSettings& settings,
                                const CancellationToken& cancellation) override;

 private:
  int threads_;
  std::map<int, std::shared_ptr<const KeyframePoints>> keyframes_;
  int next_ = 0;
  CpuFrame frame_;
  ScratchPool<StartAligner> workspaces_;
};

}  // namespace nerf_pose_refiner
