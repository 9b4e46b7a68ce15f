// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <stdexcept>

#include "backend/cost_counters.h"
#include "backend/cpu/ray_renderer.h"
#include "backend/loaded_field.h"
#include "field/field.h"

namespace nerf_pose_refiner {

/// A scene of opaque surfaces with which rays are intersected exactly, in place of a learned field.
/// For alignment, which needs no gradients of rays.
class OpaqueScene : public RayRenderer {
 public:
  const Field& field() const final { return field_; }

  CostCounters renderRays(RaySpan rays, const RenderOptions& options,
                          RayResult* results) const final {
    for (int i = 0; i < rays.size; ++i) results[i] = trace(rays[i], options);
    CostCounters cost;
    cost.rays = cost.samples = static_cast<std::uint64_t>(rays.size);
    return cost;
  }

  CostCounters rayGradients(RaySpan, const RenderOptions&, bool, const RayLoss&,
                            RayGradient*) const final {
    throw std::logic_error("an opaque scene has no gradients");
  }

 protected:
  using RayRenderer::RayRenderer;

  Field field_;

 private:
  /// What a ray shows; zeros if it hits nothing.
  virtual RayResult trace(const Ray& ray, const RenderOptions& options) const = 0;
};

}  // namespace nerf_pose_refiner
