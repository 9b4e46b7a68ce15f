// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/ray_renderer.h"

#include "backend/common/solver_rules.h"
#include "backend/cpu/cpu_solver.h"
#include "backend/cpu/rendered_image.h"
#include "field/field.h"

namespace nerf_pose_refiner {

Rendering RayRenderer::render(const View& view, const RenderOptions& options,
                              const CancellationToken& cancellation) const {
  requireView(view);
  Image image;
  renderImages(*this, {{view.camera, view.T_O_C, 1, &image}}, options, cancellation);
  return unpacked(view.camera, image.values.data(), field().metadata.centre.cast<float>());
}

std::unique_ptr<PoseSolver> RayRenderer::makeSolver(const Observation& observation,
                                                    const std::vector<ImageLevel>& levels,
                                                    int capacity) const {
  requireSolver(observation, levels, capacity);
  return std::make_unique<CpuSolver>(*this, observe(observation, levels, processor_->threads),
                                     capacity);
}

}  // namespace nerf_pose_refiner
