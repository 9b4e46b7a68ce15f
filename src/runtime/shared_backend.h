// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "backend/backend.h"
#include "backend/cost_counters.h"
#include "backend/loaded_field.h"
#include "backend/pose_solver.h"
#include "backend/training.h"
#include "field/field.h"

namespace nerf_pose_refiner {

/// One backend for many threads. Their calls run one after another, in the order in which they were
/// made, so that two concurrent refinements each take about twice their time. A field is loaded
/// once for all its users. A solver or a trainer still belongs to one thread. Costs are those of
/// all threads together.
class SharedBackend final : public Backend {
 public:
  explicit SharedBackend(std::unique_ptr<Backend> backend);
  ~SharedBackend() override;

  BackendInfo info() const override;
  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) override;
  /// Aligners are not serialised, nor are matchers and indices.
  std::unique_ptr<KeyframeAligner> makeKeyframeAligner() override;
  std::unique_ptr<TemplateMatcher> makeTemplateMatcher(
      std::shared_ptr<const TemplateBank> bank, const TemplateMatchSettings& settings) override;
  std::unique_ptr<DescriptorIndex> makeDescriptorIndex(const Descriptors& rows) override;
  /// Each step of the trainer is serialised on its own.
  std::unique_ptr<FieldTrainer> makeTrainer(const FieldConfig& config, const Box& box,
                                            std::vector<TrainingView> views,
                                            const TrainingPlan& plan) override;
  CostCounters costs() const override;

  class TicketLock;

 private:
  std::shared_ptr<TicketLock> lock_;  ///< shared with all that the backend created
  std::unique_ptr<Backend> backend_;
  std::map<const Field*, std::weak_ptr<const LoadedField>> loaded_;  ///< guarded by lock_
};

}  // namespace nerf_pose_refiner
