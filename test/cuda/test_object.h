// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <memory>

#include "backend/loaded_field.h"
#include "image/colour.h"
#include "nerf_pose_refiner/observation.h"
#include "support/random_field.h"

namespace nerf_pose_refiner {

/// Leaves a ball and a smaller one on its side of a field's box, in model units, and sets what is
/// known of the object.
inline void carveBalls(Field* field) {
  const int n = field->config.occupancy_resolution;
  field->occupancy.resolution = n;
  field->occupancy.bits.assign(static_cast<std::size_t>(n) * n * n / 8, 0);
  const Eigen::Vector3d size = (field->box.max - field->box.min) / field->cubeSide();
  const double radius = 0.32 * size.minCoeff();
  const Eigen::Vector3d middle = Eigen::Vector3d::Constant(0.5);
  const Eigen::Vector3d side = middle + Eigen::Vector3d(0.9, 0.6, 0.3) * radius;
  for (int z = 0; z < n; ++z) {
    for (int y = 0; y < n; ++y) {
      for (int x = 0; x < n; ++x) {
        const Eigen::Vector3d p = (Eigen::Vector3d(x, y, z).array() + 0.5) / n;
        if ((p - middle).norm() > radius && (p - side).norm() > 0.6 * radius) continue;
        const std::size_t i = (static_cast<std::size_t>(z) * n + y) * n + x;
        field->occupancy.bits[i >> 3] |= static_cast<std::uint8_t>(1u << (i & 7));
      }
    }
  }
  field->metadata.centre = field->cubeCentre();
  field->metadata.diameter = 2.4 * radius * field->cubeSide();
}

/// The analytic scene as a small field learns it on the CPU; made once, when first asked for.
const Field& learnedObject();

/// A camera that looks at the field's centre from a distance, turned by a little.
inline Pose cameraBefore(const Field& field, double distance) {
  Pose T_O_C;
  T_O_C.R = (Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.3, 1, 0.2).normalized()) *
             Eigen::AngleAxisd(-0.4, Eigen::Vector3d::UnitX()))
                .toRotationMatrix();
  T_O_C.t = field.cubeCentre() - distance * T_O_C.R.col(2);
  return T_O_C;
}

/// The pose, turned by about `degrees` about the field's centre and moved by a share of the
/// object's diameter.
inline Pose disturbed(const Pose& T_O_C, const Field& field, double degrees, double fraction) {
  const Eigen::Vector3d c = field.metadata.centre;
  const Eigen::Matrix3d turn = expSO3(
      Eigen::Vector3d(degrees * EIGEN_PI / 180 * Eigen::Vector3d(0.6, -0.5, 0.62).normalized()));
  const Eigen::Vector3d move =
      fraction * field.metadata.diameter * Eigen::Vector3d(0.5, 0.7, -0.5).normalized();
  return {turn * T_O_C.R, c + turn * (T_O_C.t - c) + move};
}

/// What a camera sees of a field, as its backend renders it, before a background.
inline Observation observe(const LoadedField& field, const Camera& camera, const Pose& T_O_C,
                           Background background) {
  const Rendering rendering = field.render({camera, T_O_C}, {}, {});
  Observation observation;
  observation.camera = camera;
  observation.background = background;
  if (background == Background::kKnownAlpha) {
    observation.image = rendering.colour;
    observation.alpha = rendering.alpha;
    return observation;
  }
  if (background == Background::kUnknown) {
    observation.image = rendering.colour;
    for (int y = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x) {
        const float free = 1 - rendering.alpha.at(x, y, 0);
        const float u = static_cast<float>(x), v = static_cast<float>(y);
        observation.image.at(x, y, 0) += free * (0.4f + 0.3f * std::sin(0.21f * u + 0.13f * v));
        observation.image.at(x, y, 1) += free * (0.5f + 0.2f * std::sin(0.17f * v - 0.09f * u));
        observation.image.at(x, y, 2) +=
            free * (0.45f + 0.3f * std::cos(0.11f * u) * std::sin(0.3f * v));
      }
    }
    for (float& value : observation.image.values) value = 0.04f + 0.9f * value;  // other light
    return observation;
  }
  observation.background_colour = {0.9f, 0.8f, 0.7f};
  observation.image = composite({rendering.colour, rendering.alpha}, {0.9f, 0.8f, 0.7f});
  if (background == Background::kMask) {
    observation.alpha = rendering.alpha;
    for (float& v : observation.alpha.values) v = v > 0.5f ? 1.0f : 0.0f;
    for (float& v : observation.image.values) v = 0.05f + 0.8f * v;  // other light
  }
  return observation;
}

}  // namespace nerf_pose_refiner
