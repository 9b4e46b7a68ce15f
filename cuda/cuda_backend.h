// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/backend.h"
#include "backend/cost_counters.h"
#include "backend/loaded_field.h"
#include "backend/training.h"
#include "cuda_processor.h"
#include "field/field.h"

namespace nerf_pose_refiner {

/// A CUDA device.
class CudaBackend final : public Backend {
 public:
  explicit CudaBackend(int device);

  BackendInfo info() const override;
  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) override;
  std::unique_ptr<KeyframeAligner> makeKeyframeAligner() override;
  std::unique_ptr<TemplateMatcher> makeTemplateMatcher(
      std::shared_ptr<const TemplateBank> bank, const TemplateMatchSettings& settings) override;
  std::unique_ptr<DescriptorIndex> makeDescriptorIndex(const Descriptors& rows) override;
  std::unique_ptr<FieldTrainer> makeTrainer(const FieldConfig& config, const Box& box,
                                            std::vector<TrainingView> views,
                                            const TrainingPlan& plan) override;
  CostCounters costs() const override { return processor_->costs(); }

 private:
  std::shared_ptr<CudaProcessor> processor_;
};

}  // namespace nerf_pose_refiner
