// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/common/keyframe_rules.h"
#include "backend/common/self_occlusion.h"
#include "backend/cpu/cpu_frame.h"
#include "backend/cpu/level_grid.h"
#include "backend/cpu/outline_groups.h"

namespace nerf_pose_refiner {

/// Aligns one keyframe with a frame from one start. Keeps its memory from start to start.
class StartAligner {
 public:
  explicit StartAligner(const KeyframeKernels& kernels) : kernels_(&kernels) {}

  /// @see KeyframeAligner::align
  Hypothesis align(const CpuFrame& frame, const KeyframePoints& keyframe, const Pose& start_T_O_C,
                   const KeyframeAlignmentSettings& settings);

 private:
  void beginLevel(int level, const CameraPose<double>& pose);
  AlignedKeyframe evaluate(const CameraPose<double>& pose, const KeyframeLevelRules& rules);
  AlignedKeyframe alignLevel(const std::vector<CameraPose<double>>& starts,
                             const KeyframeLevelRules& rules);
  void findEvidence(const KeyframeLevelRules& rules, AlignedKeyframe* aligned);
  KernelColours colours() const;
  PointTransform<float> transformOf(const CameraPose<double>& pose) const;
  void hideOccluded(const CameraPose<double>& pose);
  void findLight();
  void compareWhatIsSeen();
  void carryGradients(const CameraPose<double>& pose);
  void lookAround(const CameraPose<double>& pose);

  const KeyframeKernels* kernels_;
  SelfOcclusion occlusion_;
  // Of the start that is being aligned:
  const KeyframePoints* keyframe_ = nullptr;
  int evaluations_ = 0;
  // Of the level that is being aligned:
  const KeyframeLevel* level_ = nullptr;
  KernelImage image_ = {};
  std::vector<std::int32_t> hidden_;  // cells of the keyframe that the object itself hides
  LevelGrid grid_;
  OutlineGroups outline_;
  LightChange light_ = {0, 0, 0};  // from the keyframe to the frame
  std::vector<LightSample> light_samples_;
  // Of the chosen points:
  std::vector<float> weight_, brightness_, gain_;
  std::vector<float> rendered_[3], rendered_du_[3], rendered_dv_[3];
  LocalColourColumns rendered_local_, local_;  // around them in the rendering, in the frame
  double shown_weight_ = 0;                    // of all
};

}  // namespace nerf_pose_refiner
