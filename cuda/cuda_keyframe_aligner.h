// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <vector>

#include "backend/keyframe_aligner.h"
#include "cuda_frame.h"
#include "cuda_keyframe.h"

namespace nerf_pose_refiner {

/// Aligns keyframes on a CUDA device: all starts by one launch. Nothing but frames is shared with
/// what else its backend does, and its stream goes first.
class CudaKeyframeAligner final : public KeyframeAligner {
 public:
  /// @param device the calling thread's. @param frames of the backend.
  CudaKeyframeAligner(int device, std::shared_ptr<CudaFrames> frames);
  ~CudaKeyframeAligner() override;

  int add(std::shared_ptr<const KeyframePoints> keyframe) override;
  void expect(const std::shared_ptr<const KeyframePoints>& keyframe) override;
  void remove(int keyframe) override;
  void observe(const Observation& observation, const FrameWindow& window) override;
  std::vector<Hypothesis> align(const std::vector<KeyframeStart>& starts,
                                const KeyframeAlignmentSettings& settings,
                                const CancellationToken& cancellation) override;
  bool alignsSideBySide() const override { return limits_.processors >= 2 * limits_.most_blocks; }

 private:
  /// Memory of alignment; it grows and stays.
  struct Scratch {
    DeviceBuffer<float4> rows;
    DeviceBuffer<unsigned> seen_cells;
    DeviceBuffer<OcclusionTest> tests;
    DeviceBuffer<int> nearest;
    DeviceBuffer<SeenPoint> points;
    DeviceBuffer<float> chunk_sums, group_sums;
  };

  KeyframeMemory spareMemory();
  void keepSpare(KeyframeMemory memory);
  CudaKeyframeStart startOf(const KeyframeStart& start,
                            const KeyframeAlignmentSettings& settings) const;
  KeyframeScratch scratchFor(const KeyframeSpace& space, int crews);

  int device_;
  KeyframeDevice limits_;
  CudaStream stream_;
  std::map<int, CudaKeyframe> keyframes_;
  int next_ = 0;
  PinnedBuffer<unsigned char> staged_;
  CudaEvent uploaded_;
  // Of `expect`, beside all else.
  std::mutex expecting_;  ///< held by a call
  CudaStream expected_stream_;
  PinnedBuffer<unsigned char> expected_staged_;
  std::mutex shared_;                     ///< guards what follows
  std::optional<CudaKeyframe> expected_;  ///< its upload is complete
  std::vector<KeyframeMemory> spare_;     ///< of keyframes that were removed
  CudaFrame frame_;
  Scratch scratch_;
  PinnedBuffer<CudaKeyframeStart> starts_;  ///< the device reads and writes the host's memory
  PinnedBuffer<CudaAlignedKeyframe> found_;
};

}  // namespace nerf_pose_refiner
