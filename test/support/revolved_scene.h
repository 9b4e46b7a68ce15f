// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "backend/loaded_field.h"
#include "support/opaque_scene.h"

namespace nerf_pose_refiner {

/// An object whose image does not tell how far it is turned about its z axis, 1 unit long, in the
/// place of a learned field: a banded bottle, or a banded cylinder that may stand on its head, too.
/// (Only the label of a labelled bottle, around its +x side, tells.)
class RevolvedScene final : public OpaqueScene {
 public:
  enum class Shape { kBottle, kCylinder, kLabelled };

  explicit RevolvedScene(Shape shape) : shape_(shape) {
    const SymmetryAxis x = {Eigen::Vector3d::UnitX(), Eigen::Vector3d::Zero()};
    FieldMetadata& object = field_.metadata;
    object.name = shape == Shape::kCylinder ? "cylinder" : "bottle";
    object.diameter = 1.08;
    if (shape != Shape::kCylinder) object.centre.z() = -0.1;
    if (shape == Shape::kLabelled) return;
    object.symmetries = shape == Shape::kBottle
                            ? Symmetries(SymmetryAxis(), {})
                            : Symmetries(SymmetryAxis(), {turnAbout(x, 3.14159265358979)});
  }

 private:
  static constexpr float kNowhere = std::numeric_limits<float>::infinity();

  /// Distance to a solid cylinder about z.
  static float hitCylinder(const Eigen::Vector3f& o, const Eigen::Vector3f& d, float radius,
                           float bottom, float top) {
    const float a = d.head<2>().squaredNorm(), b = o.head<2>().dot(d.head<2>());
    const float root = b * b - a * (o.head<2>().squaredNorm() - radius * radius);
    if (root < 0) return kNowhere;
    const float to_bottom = (bottom - o.z()) / d.z(), to_top = (top - o.z()) / d.z();
    const float enter = std::max((-b - std::sqrt(root)) / a, std::min(to_bottom, to_top));
    const float leave = std::min((-b + std::sqrt(root)) / a, std::max(to_bottom, to_top));
    return enter > 0 && enter < leave ? enter : kNowhere;
  }

  static bool isLabel(const Eigen::Vector3f& p) {
    constexpr float kHalfWidth_rad = 0.7f;
    return std::abs(std::atan2(p.y(), p.x())) < kHalfWidth_rad && p.z() > -0.4f && p.z() < 0.05f;
  }

  RayResult trace(const Ray& ray, const RenderOptions& options) const override {
    const Eigen::Vector3f o = Eigen::Map<const Eigen::Vector3f>(ray.origin);
    const Eigen::Vector3f d = Eigen::Map<const Eigen::Vector3f>(ray.direction);
    const bool bottle = shape_ != Shape::kCylinder;
    float distance = hitCylinder(o, d, 0.2f, -0.5f, bottle ? 0.15f : 0.5f);
    if (bottle) distance = std::min(distance, hitCylinder(o, d, 0.08f, 0.15f, 0.5f));
    RayResult result = {};
    if (!std::isfinite(distance) || distance < options.near) return result;
    const Eigen::Vector3f p = o + distance * d;
    const float z = bottle ? p.z() : std::abs(p.z()), r = p.head<2>().norm();
    for (int c = 0; c < 3; ++c) {
      const float phase = static_cast<float>(c);
      result.rgb[c] = 0.5f + 0.2f * std::sin(25 * z + 2 * phase) + 0.2f * std::cos(30 * r + phase);
      result.point[c] = p[c];
    }
    if (shape_ == Shape::kLabelled && isLabel(p)) {
      const bool dark = std::sin(40 * p.y()) * std::sin(50 * p.z()) > 0;
      for (float& colour : result.rgb) colour = dark ? 0.1f : 0.95f;
    }
    result.alpha = 1;
    return result;
  }

  Shape shape_;
};

}  // namespace nerf_pose_refiner
