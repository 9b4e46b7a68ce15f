// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>
#include <vector>

#include "backend/cost_counters.h"
#include "backend/cpu/ray_renderer.h"
#include "backend/loaded_field.h"
#include "field/field.h"
#include "support/frozen_ray.h"

namespace nerf_pose_refiner {

/// A volume whose gradients are exact and smooth, in the place of a learned field: three textured
/// Gaussian clouds, without symmetry, in a ball of one unit across. For tests of the paper's mode.
class FogScene final : public RayRenderer {
 public:
  /// @param scale multiplies all lengths.
  explicit FogScene(double scale = 1,
                    std::shared_ptr<CpuProcessor> processor = std::make_shared<CpuProcessor>())
      : RayRenderer(std::move(processor)), scale_(scale) {
    field_.metadata.name = "fog";
    field_.metadata.diameter = scale;
    field_.box.min = Eigen::Vector3d::Constant(-0.5 * scale);
    field_.box.max = Eigen::Vector3d::Constant(0.5 * scale);
  }

  const Field& field() const override { return field_; }

  CostCounters renderRays(RaySpan rays, const RenderOptions&, RayResult* results) const override {
    CostCounters cost;
    for (int i = 0; i < rays.size; ++i) results[i] = toResult(trace(rays[i], &cost));
    return cost;
  }

  CostCounters rayGradients(RaySpan rays, const RenderOptions&, bool direction_gradient,
                            const RayLoss& loss, RayGradient* gradients) const override {
    CostCounters cost;
    for (int i = 0; i < rays.size; ++i) {
      const Trace ray = trace(rays[i], &cost);
      const RayLossGradient g = loss(i, toResult(ray));
      const RayColour gradient = {{g.rgb[0], g.rgb[1], g.rgb[2]}, g.alpha};
      const FrozenGradient of_ray =
          gradientOf(ray.direction, ray.samples, ray.occupied_volume, gradient, direction_gradient);
      for (int a = 0; a < 3; ++a) {
        gradients[i].force[a] = static_cast<float>(of_ray.force[a] / scale_);
        gradients[i].torque[a] = static_cast<float>(of_ray.torque[a]);
      }
    }
    return cost;
  }

 private:
  struct Trace {
    Eigen::Vector3d direction;
    std::vector<FrozenSample> samples;
    std::vector<OccupiedVolume> occupied_volume;
  };

  static constexpr double kRadius = 0.5;
  static constexpr int kSamples = 16;

  // Lengths in units of `scale_`.
  Trace trace(const Ray& ray, CostCounters* work) const {
    ++work->rays;
    Trace result;
    result.direction = Eigen::Map<const Eigen::Vector3f>(ray.direction).cast<double>();
    const Eigen::Vector3d origin =
        Eigen::Map<const Eigen::Vector3f>(ray.origin).cast<double>() / scale_;
    const double nearest = -origin.dot(result.direction);
    const double miss = (origin + nearest * result.direction).norm();
    if (miss >= kRadius || nearest < 0) return result;
    const double half = std::sqrt(kRadius * kRadius - miss * miss);
    const double length = 2 * half / kSamples;
    for (int i = 0; i < kSamples; ++i) {
      const double t = nearest - half + (i + 0.5) * length;
      result.samples.push_back({t, length});
      result.occupied_volume.push_back(occupiedVolumeAt(origin + t * result.direction));
    }
    work->samples += kSamples;
    return result;
  }

  static OccupiedVolume occupiedVolumeAt(const Eigen::Vector3d& p) {
    static const Eigen::Vector4d kClouds[3] = {
        {0, 0, 0, 0.12}, {0.2, 0.1, 0.05, 0.07}, {-0.1, -0.05, 0.22, 0.06}};  // centre, radius
    Dual x[3];
    for (int a = 0; a < 3; ++a) {
      x[a].value = p[a];
      x[a].d[a] = 1;
    }
    OccupiedVolume occupied_volume;
    for (const Eigen::Vector4d& cloud : kClouds) {
      Dual square;
      for (int a = 0; a < 3; ++a) {
        const Dual away = -cloud[a] + x[a];
        square = square + away * away;
      }
      occupied_volume.density =
          occupied_volume.density + 25.0 * exponential(-0.5 / (cloud[3] * cloud[3]) * square);
    }
    for (int c = 0; c < 3; ++c) {
      const Dual wave = 9.0 * x[c] + 5.0 * x[(c + 1) % 3];
      occupied_volume.rgb[c] = 0.5 + 0.4 * sine(0.7 * c + wave);
    }
    return occupied_volume;
  }

  RayResult toResult(const Trace& ray) const {
    const RayColour colour = composite(ray.samples, ray.occupied_volume);
    RayResult result = {};
    for (int c = 0; c < 3; ++c) result.rgb[c] = static_cast<float>(colour.rgb[c]);
    result.alpha = static_cast<float>(colour.alpha);
    return result;
  }

  double scale_;
  Field field_;
};

}  // namespace nerf_pose_refiner
