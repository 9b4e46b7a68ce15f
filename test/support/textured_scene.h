// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>

#include "backend/cost_counters.h"
#include "backend/loaded_field.h"
#include "math/random.h"
#include "support/analytic_scene.h"

namespace nerf_pose_refiner {

/// The analytic scene with blotches of two sizes on it, that local features are found at.
class TexturedScene final : public RayRenderer {
 public:
  explicit TexturedScene(std::shared_ptr<CpuProcessor> processor)
      : RayRenderer(processor), plain_(makeAnalyticScene(1, std::move(processor))) {}

  const Field& field() const override { return plain_->field(); }

  CostCounters renderRays(RaySpan rays, const RenderOptions& options,
                          RayResult* results) const override {
    const CostCounters cost = plain_->renderRays(rays, options, results);
    for (int i = 0; i < rays.size; ++i) {
      if (results[i].alpha == 0) continue;
      const float brightness =
          0.2f + 0.4f * blotches(results[i].point, 8) + 0.4f * blotches(results[i].point, 20);
      for (float& colour : results[i].rgb) colour *= brightness;
    }
    return cost;
  }

  CostCounters rayGradients(RaySpan rays, const RenderOptions& options, bool direction,
                            const RayLoss& loss, RayGradient* gradients) const override {
    return plain_->rayGradients(rays, options, direction, loss, gradients);
  }

 private:
  /// Random numbers on a lattice of `cells` a unit, linear between them: 0..1.
  static float blotches(const float point[3], float cells) {
    float sum = 0;
    for (int corner = 0; corner < 8; ++corner) {
      float weight = 1;
      std::uint64_t node = static_cast<std::uint64_t>(cells);
      for (int axis = 0; axis < 3; ++axis) {
        const float x = cells * (point[axis] + 1);
        const float cell = std::floor(x);
        const int step = corner >> axis & 1;
        weight *= step == 1 ? x - cell : 1 - (x - cell);
        node = 64 * node + static_cast<std::uint64_t>(cell) + static_cast<std::uint64_t>(step);
      }
      sum += weight * randomUniform(11, 5, node);
    }
    return sum;
  }

  std::shared_ptr<const RayRenderer> plain_;
};

}  // namespace nerf_pose_refiner
