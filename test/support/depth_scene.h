// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <utility>

#include "backend/make_backend.h"
#include "math/angle.h"
#include "math/random.h"
#include "nerf_pose_refiner/depth.h"
#include "refinement/keyframe_refiner.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"
#include "support/metric_field.h"
#include "support/scene_before_clutter.h"
#include "views/keyframe.h"

namespace nerf_pose_refiner {

/// What a depth camera of tests does beside measuring. Its errors are not those that DepthNoise
/// describes: they go together over patches that are interpolated, holes come in patches.
struct DepthErrors {
  double noise_m = 0;  ///< deviation
  double bias_m = 0;   ///< added to each pixel
  double holes = 0;    ///< fraction
  double step_m = 0;   ///< of quantisation
  std::uint64_t seed = 1;
};

/// The analytic scene, half a metre before a camera, with depth.
class DepthScene {
 protected:
  static constexpr double kUnit_m = 0.2, kWall_m = 0.9;

  const FieldMetadata& object() const { return field_->field().metadata; }

  /// Smooth numbers of deviation 1, about.
  static double patches(std::uint64_t seed, std::uint64_t stream, double x, double y) {
    const double fx = std::floor(x), fy = std::floor(y);
    double sum = 0, squares = 0;
    for (int corner = 0; corner < 4; ++corner) {
      const double u = corner & 1 ? x - fx : 1 - (x - fx), v = corner & 2 ? y - fy : 1 - (y - fy);
      const auto node = static_cast<std::uint64_t>(fx + (corner & 1)) * 4096 +
                        static_cast<std::uint64_t>(fy + (corner >> 1 & 1));
      sum += u * v * std::sqrt(12.0) * (randomUniform(seed, stream, node) - 0.5);
      squares += u * v * u * v;
    }
    return sum / std::sqrt(squares);
  }

  /// Depth of the scene before a wall, seen by a camera at T_C_D [m].
  ImageOf<float> metresAt(const Pose& T_O_C, const Camera& camera, const Pose& T_C_D = {},
                          const DepthErrors& errors = {}) const {
    const Pose T_O_D = T_O_C * Pose(T_C_D.R, T_C_D.t / kUnit_m);
    const Rendering picture = field_->render({camera, T_O_D}, RenderOptions(), {});
    const Pose T_D_O = T_O_D.inverse();
    ImageOf<float> depth(camera.width, camera.height, 1, static_cast<float>(kWall_m));
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        double value = kWall_m;
        if (picture.alpha.at(x, y, 0) > 0.5f) {
          const Eigen::Vector3f p = Eigen::Map<const Eigen::Vector3f>(picture.point.pixel(x, y));
          value = kUnit_m * (T_D_O * p.cast<double>()).z();
        }
        value += errors.bias_m + errors.noise_m * patches(errors.seed, 1, x / 4.0, y / 4.0);
        if (errors.step_m > 0) value = errors.step_m * std::round(value / errors.step_m);
        const double hole = 0.5 * std::erfc(-patches(errors.seed, 2, x / 6.0, y / 6.0) / M_SQRT2);
        depth.at(x, y, 0) = hole < errors.holes ? 0.0f : static_cast<float>(value);
      }
    }
    return depth;
  }

  /// The colour image before clutter.
  Observation imageAt(const Pose& T_O_C) const {
    return sceneBeforeClutter(*field_, kColour, T_O_C);
  }

  /// Moved along the line of sight, away from the camera [m].
  Pose fartherBy(const Pose& T_O_C, double metres) const {
    return {T_O_C.R, T_O_C.t + metres / kUnit_m * (T_O_C.t - object().centre).normalized()};
  }

  /// How much farther the object is than in truth [m].
  double alongSight(const Pose& T_O_C) const {
    return kUnit_m * ((T_O_C.t - object().centre).norm() - (truth_.t - object().centre).norm());
  }

  std::unique_ptr<KeyframeRefiner> refiner() const {
    KeyframeSearchSettings settings;
    settings.real_time = false;
    return std::make_unique<KeyframeRefiner>(backend_.get(), field_, settings);
  }

  const Camera kColour = {320, 240, 400, 400, 159.5, 119.5};
  std::shared_ptr<const LoadedField> scene_ = makeAnalyticScene(1, cpuProcessor(2));
  std::shared_ptr<const LoadedField> field_ = std::make_shared<MetricField>(scene_, kUnit_m);
  Pose truth_ = cameraAround(*scene_, 0.6, 0.5);
  std::unique_ptr<Backend> backend_ = makeCpuBackend(2);
};

}  // namespace nerf_pose_refiner
