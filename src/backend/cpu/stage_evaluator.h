// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/common/alignment_system.h"
#include "backend/common/region_model.h"
#include "backend/cpu/cpu_backend.h"

namespace nerf_pose_refiner {

/// A pose, what it looks like, and how well that fits.
struct Evaluation {
  Pose T_O_C;
  GainBias<float> gain_bias;
  Image image, scratch;
  Image behind;  ///< for contrasts: what the observation shows beside the rendered object
  AlignmentSums sums;
};

/// One stage: the poses' common target, and how images of them are made and compared with it.
class StageEvaluator {
 public:
  StageEvaluator(const RayRenderer& scene, const CpuObservation& observation, int level,
                 const AlignStage& stage, int threads, const CancellationToken& stop,
                 CostCounters* work);

  void rankByRegions() { target_.rules.rank_by_regions = true; }
  const AlignmentTarget& target() const { return target_; }
  const FieldMetadata& object() const { return scene_.field().metadata; }

  void evaluate(const std::vector<Evaluation*>& evaluations);

 private:
  bool comparesContrasts() const { return target_.rules.kind == Comparison::kContrasts; }
  void render(const std::vector<Evaluation*>& evaluations);
  void buildRegions(const std::vector<Evaluation*>& evaluations);
  void blurAll(const std::vector<Evaluation*>& evaluations);
  void takeContrasts(const std::vector<Evaluation*>& evaluations);
  void fitGainBiases(const std::vector<Evaluation*>& evaluations);
  template <typename Sums, typename SumRows>
  std::vector<Sums> sumChunks(int count, const SumRows& sum_rows) const;

  const RayRenderer& scene_;
  const AlignStage& stage_;
  int threads_;
  const CancellationToken& stop_;
  CostCounters* work_;
  AlignmentTarget target_;
  RegionModel regions_;
  bool needs_regions_;
  std::vector<float> image_kernel_;
  std::vector<float> contrast_window_;  // half a kernel
  Image observed_contrast_;
};

}  // namespace nerf_pose_refiner
