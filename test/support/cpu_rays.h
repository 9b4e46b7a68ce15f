// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "backend/cost_counters.h"
#include "backend/cpu/cpu_field.h"
#include "backend/loaded_field.h"
#include "math/random.h"

namespace nerf_pose_refiner {

using Rays = std::vector<Ray>;
using Results = std::vector<RayResult>;

inline RaySpan spanOf(const Rays& rays) { return {rays.data(), static_cast<int>(rays.size())}; }

/// A field in the CPU backend.
inline std::shared_ptr<const RayRenderer> load(const Field& field,
                                               const char* instruction_set = "auto") {
  auto processor = std::make_shared<CpuProcessor>();
  processor->kernels = &selectCpuKernels(instruction_set);
  return std::make_shared<CpuField>(std::make_shared<Field>(field), std::move(processor));
}

inline Results render(const RayRenderer& scene, const Rays& rays, const RenderOptions& options = {},
                      CostCounters* work = nullptr) {
  Results results(rays.size());
  const CostCounters cost = scene.renderRays(spanOf(rays), options, results.data());
  if (work) *work += cost;
  return results;
}

/// Options with which every sample counts.
inline RenderOptions everything() {
  RenderOptions options;
  options.min_transmittance = 0;
  options.min_weight = 0;
  options.use_occupancy = false;
  return options;
}

inline Ray rayFromTo(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3f o = from.cast<float>(), d = (to - from).normalized().cast<float>();
  return {{o.x(), o.y(), o.z()}, {d.x(), d.y(), d.z()}};
}

/// Rays from around the box, some from inside, to points in and near it; lengths times `scale`.
inline Rays randomRays(const Field& field, int count, double scale = 1) {
  Rays rays;
  for (int i = 0; i < count; ++i) {
    Eigen::Vector3d from, to;
    for (int a = 0; a < 3; ++a) {
      const auto uniform = [&](int k, double low, double high) {
        return low + (high - low) * randomUniform(11, i, 8 * a + k);
      };
      const double size = field.box.max[a] - field.box.min[a], middle = field.cubeCentre()[a];
      from[a] = i % 5 == 0 ? middle + 0.4 * uniform(0, -size, size) : middle + uniform(0, -4, 4);
      to[a] = middle + 0.55 * uniform(1, -size, size);
    }
    rays.push_back(rayFromTo(scale * from, scale * to));
  }
  return rays;
}

}  // namespace nerf_pose_refiner
