// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/cpu/alignment_system.h"
#include "backend/cpu/cpu_observation.h"
#include "backend/cpu/region_model.h"
#include "field/field.h"

namespace nerf_pose_refiner {

/// A pose, what it looks like, and how well that fits.
struct Evaluation {
  Pose T_O_C;
  GainBias<float> gain_bias;
  Image image, scratch;
  Image behind;  ///< for contrasts: what the observation shows beside the rendered object
  AlignmentSums sums;
};

/// What a stage of a schedule asks for.
struct StageRequest {
  int level;
  const AlignStage& align;
  const CancellationToken& cancellation;
};

/// One stage: the poses' common target, and how images of them are made and compared with it.
class StageEvaluator {
 public:
  /// @throws std::invalid_argument if there is no such level.
  StageEvaluator(const RayRenderer& scene, const CpuObservation& observation,
                 const StageRequest& request);

  void rankByRegions() { target_.rules.rank_by_regions = true; }
  const AlignmentTarget& target() const { return target_; }
  const FieldMetadata& object() const { return scene_.field().metadata; }

  void evaluate(const std::vector<Evaluation*>& evaluations);

 private:
  class Steps;  ///< of an evaluation, @see evaluateInOrder

  const RayRenderer& scene_;
  const StageRequest request_;
  AlignmentTarget target_;
  RegionModel regions_;
  bool needs_regions_;
  std::vector<float> image_kernel_;     // half of it
  std::vector<float> contrast_window_;  // the same
  Image observed_contrast_;
};

}  // namespace nerf_pose_refiner
