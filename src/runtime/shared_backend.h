// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "backend/training.h"
#include "field/field.h"
#include "nerf_pose_refiner/backend.h"

namespace nerf_pose_refiner {

/// One backend for many threads: they take turns call by call, in the order in which they ask, so
/// that of two refinements at once each is done in about twice its time. A field is loaded once,
/// its users. A solver or a trainer still belongs to one thread.
///
/// Its costs are those of all threads together.
class SharedBackend final : public Backend {
 public:
  explicit SharedBackend(std::unique_ptr<Backend> backend);
  ~SharedBackend() override;

  BackendInfo info() const override;
  std::shared_ptr<const LoadedField> load(std::shared_ptr<const Field> field) override;
  /// Aligners take no turns.
  std::unique_ptr<KeyframeAligner> makeKeyframeAligner() override;
  /// A step of the trainer is a turn.
  std::unique_ptr<FieldTrainer> makeTrainer(const FieldConfig& config, const Box& box,
                                            std::vector<TrainingView> views,
                                            const TrainingPlan& plan) override;
  CostCounters costs() const override;

  class Turns;

 private:
  std::shared_ptr<Turns> turns_;  ///< shared with what was made
  std::unique_ptr<Backend> backend_;
  std::map<const Field*, std::weak_ptr<const LoadedField>> loaded_;  ///< used in a turn only
};

}  // namespace nerf_pose_refiner
