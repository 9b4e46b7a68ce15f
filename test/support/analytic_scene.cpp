// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "analytic_scene.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "image/resample.h"
#include "support/opaque_scene.h"

namespace nerf_pose_refiner {
namespace {

const Eigen::Vector3f kBoxHalf(0.36f, 0.22f, 0.28f);
const Eigen::Vector3f kBallCentre(0.30f, 0.20f, 0.24f);
constexpr float kBallRadius = 0.15f;

struct Hit {
  float distance = std::numeric_limits<float>::infinity();
  Eigen::Vector3f point;
  Eigen::Vector3f rgb;
};

// Smooth, without symmetry, different on every side.
Eigen::Vector3f textureAt(const Eigen::Vector3f& p, float hue) {
  const float a = std::sin(9 * p.x() + 4 * p.y() + hue);
  const float b = std::sin(7 * p.y() - 5 * p.z() + 2 * hue + 1);
  const float c = std::sin(8 * p.z() + 6 * p.x() * p.y() + 3 * hue + 2);
  return {0.5f + 0.25f * a + 0.15f * b, 0.5f + 0.25f * b - 0.15f * c, 0.45f + 0.25f * c + 0.1f * a};
}

Hit hitBox(const Eigen::Vector3f& origin, const Eigen::Vector3f& d) {
  float enter = 0, leave = std::numeric_limits<float>::infinity();
  int side = 0;
  for (int a = 0; a < 3; ++a) {
    const float near = (-std::copysign(kBoxHalf[a], d[a]) - origin[a]) / d[a];
    const float far = (std::copysign(kBoxHalf[a], d[a]) - origin[a]) / d[a];
    if (near > enter) enter = near, side = a;
    leave = std::min(leave, far);
  }
  Hit hit;
  if (enter <= 0 || enter >= leave) return hit;
  hit.distance = enter;
  hit.point = origin + enter * d;
  const float shade = 1 - 0.15f * static_cast<float>(side);
  hit.rgb = shade * textureAt(hit.point, 0.3f);
  return hit;
}

Hit hitBall(const Eigen::Vector3f& origin, const Eigen::Vector3f& d) {
  const Eigen::Vector3f o = origin - kBallCentre;
  const float nearest = -o.dot(d);
  const float gap = kBallRadius * kBallRadius - (o + nearest * d).squaredNorm();
  Hit hit;
  if (nearest <= 0 || gap <= 0) return hit;
  hit.distance = nearest - std::sqrt(gap);
  hit.point = origin + hit.distance * d;
  hit.rgb = textureAt(hit.point, 2.1f);
  return hit;
}

class AnalyticScene final : public OpaqueScene {
 public:
  AnalyticScene(float scale, std::shared_ptr<CpuProcessor> processor)
      : OpaqueScene(std::move(processor)), scale_(scale) {
    field_.metadata.diameter = scale;
    field_.metadata.centre = scale * Eigen::Vector3d(0.05, -0.02, 0.03);
    field_.box.min = Eigen::Vector3d::Constant(-0.6 * scale);
    field_.box.max = Eigen::Vector3d::Constant(0.6 * scale);
  }

 private:
  RayResult trace(const Ray& ray, const RenderOptions& options) const override {
    const Eigen::Vector3f origin = Eigen::Map<const Eigen::Vector3f>(ray.origin) / scale_;
    const Eigen::Vector3f d = Eigen::Map<const Eigen::Vector3f>(ray.direction);
    const Hit box = hitBox(origin, d), ball = hitBall(origin, d);
    const Hit& hit = ball.distance < box.distance ? ball : box;
    RayResult result = {};
    if (!std::isfinite(hit.distance) || hit.distance * scale_ < options.near) return result;
    for (int c = 0; c < 3; ++c) {
      result.rgb[c] = hit.rgb[c];
      result.point[c] = scale_ * hit.point[c];
    }
    result.alpha = 1;
    return result;
  }

  float scale_;
};

}  // namespace

std::shared_ptr<const RayRenderer> makeAnalyticScene(double scale,
                                                     std::shared_ptr<CpuProcessor> processor) {
  return std::make_shared<AnalyticScene>(static_cast<float>(scale), std::move(processor));
}

Pose cameraAround(const LoadedField& scene, double azimuth_rad, double elevation_rad,
                  double distance_in_diameters) {
  const Eigen::Vector3d away(std::cos(elevation_rad) * std::cos(azimuth_rad),
                             std::cos(elevation_rad) * std::sin(azimuth_rad),
                             std::sin(elevation_rad));
  const Eigen::Vector3d forward = -away;
  const Eigen::Vector3d right = forward.cross(Eigen::Vector3d::UnitZ()).normalized();
  Pose T_O_C;
  T_O_C.R.col(0) = right;
  T_O_C.R.col(1) = forward.cross(right);
  T_O_C.R.col(2) = forward;
  const FieldMetadata& object = scene.field().metadata;
  T_O_C.t = object.centre + distance_in_diameters * object.diameter * away;
  return T_O_C;
}

Observation observeScene(const LoadedField& scene, const Camera& camera, const Pose& T_O_C) {
  constexpr int kFiner = 4;
  const Camera fine = camera.resized(kFiner * camera.width, kFiner * camera.height);
  const Rendering picture = scene.render({fine, T_O_C}, RenderOptions(), CancellationToken());
  Observation observation;
  observation.image = resample(picture.colour, fine, camera);
  observation.alpha = resample(picture.alpha, fine, camera);
  observation.camera = camera;
  observation.background = Background::kKnownAlpha;
  return observation;
}

}  // namespace nerf_pose_refiner
