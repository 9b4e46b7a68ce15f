// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/loaded_field.h"
#include "backend/plans.h"
#include "backend/pose_solver.h"
#include "cuda_processor.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// A field in the memory of a CUDA device, with the device that works on it.
class CudaLoadedField final : public LoadedField {
 public:
  /// @throws as CudaField.
  CudaLoadedField(std::shared_ptr<const Field> field, std::shared_ptr<CudaProcessor> processor);
  ~CudaLoadedField() override;

  const Field& field() const override { return memory_->field(); }
  Rendering render(const View& view, const RenderOptions& options,
                   const CancellationToken& cancellation) const override;
  std::vector<Rendering> renderAll(const Camera& camera, const std::vector<Pose>& poses_T_O_C,
                                   const RenderOptions& options,
                                   const CancellationToken& cancellation) const override;
  bool rendersTogether() const override { return true; }
  std::unique_ptr<PoseSolver> makeSolver(const Observation& observation,
                                         const std::vector<ImageLevel>& levels,
                                         int capacity) const override;

  const CudaField& memory() const { return *memory_; }
  CudaProcessor& processor() const { return *processor_; }

 private:
  std::shared_ptr<CudaProcessor> processor_;
  std::unique_ptr<const CudaField> memory_;
};

}  // namespace nerf_pose_refiner
