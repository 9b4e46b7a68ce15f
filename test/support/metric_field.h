// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <utility>

#include "backend/loaded_field.h"
#include "backend/pose_solver.h"
#include "field/field.h"

namespace nerf_pose_refiner {

/// A scene that knows its scale.
class MetricField final : public LoadedField {
 public:
  MetricField(std::shared_ptr<const LoadedField> scene, double metres_per_unit)
      : scene_(std::move(scene)), field_(scene_->field()) {
    field_.metadata.metres_per_unit = metres_per_unit;
  }

  const Field& field() const override { return field_; }

  Rendering render(const View& view, const RenderOptions& options,
                   const CancellationToken& cancellation) const override {
    return scene_->render(view, options, cancellation);
  }

  std::unique_ptr<PoseSolver> makeSolver(const Observation& observation,
                                         const std::vector<ImageLevel>& levels,
                                         int capacity) const override {
    return scene_->makeSolver(observation, levels, capacity);
  }

 private:
  std::shared_ptr<const LoadedField> scene_;
  Field field_;
};

}  // namespace nerf_pose_refiner
