// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/splat.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace nerf_pose_refiner {
namespace {

/// Points to show in an image.
struct Points {
  const KeyframeLevel* level;
  double apart;  ///< pixels of the image from one to the next, about
};

/// Those of the coarsest level that has one a pixel, or of the finest.
Points pointsFor(const KeyframePoints& keyframe, const View& view) {
  const double distance = (keyframe.centre - view.T_O_C.t).norm();
  const double own_distance = (keyframe.centre - keyframe.T_O_C.t).norm();
  const double pixels = keyframe.camera.fx / keyframe.reduction / own_distance /
                        (view.camera.fx / distance);  // of the first level, along one of the view
  const auto apart = [&](std::size_t level) {
    return (keyframe.levels[level].spacing << level) / pixels;
  };
  std::size_t level = 0;
  while (level + 1 < keyframe.levels.size() && apart(level + 1) <= 1) ++level;
  return {&keyframe.levels[level], apart(level)};
}

/// Adds a point to the pixels around a place, as much as each is near. @param reach so far [px].
void spread(const Eigen::Vector2d& place, double reach, const Eigen::Array3f& colour,
            Rendering* rendering) {
  const int width = rendering->alpha.width, height = rendering->alpha.height;
  const auto clampTo = [](double x, int size) {
    return static_cast<int>(std::clamp(x, 0.0, static_cast<double>(size)));
  };
  const int left = clampTo(std::ceil(place.x() - reach), width);
  const int right = clampTo(std::floor(place.x() + reach) + 1, width);
  const int top = clampTo(std::ceil(place.y() - reach), height);
  const int bottom = clampTo(std::floor(place.y() + reach) + 1, height);
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      const auto weight = static_cast<float>((1 - std::abs(place.x() - x) / reach) *
                                             (1 - std::abs(place.y() - y) / reach));
      rendering->alpha.at(x, y, 0) += weight;
      Eigen::Map<Eigen::Array3f>(rendering->colour.pixel(x, y)) += weight * colour;
    }
  }
}

/// Makes weighted sums of colours their means, where points cover the pixel.
void normalise(Rendering* rendering) {
  constexpr float kCovered = 0.5f;  // of the weight inside the object: less is the rim, or a gap
  for (std::size_t i = 0; i < rendering->alpha.pixels(); ++i) {
    float& alpha = rendering->alpha.values[i];
    const bool is_covered = alpha > kCovered;
    const float scale = is_covered ? 1 / alpha : 0;
    for (std::size_t c = 0; c < 3; ++c) rendering->colour.values[3 * i + c] *= scale;
    alpha = is_covered ? 1 : 0;
  }
}

}  // namespace

Rendering splat(const KeyframePoints& keyframe, const View& view) {
  const Points points = pointsFor(keyframe, view);
  const KeyframeLevel& level = *points.level;
  const double reach = std::max(1.0, points.apart);
  const Camera& camera = view.camera;
  Rendering rendering;
  rendering.alpha = Image(camera.width, camera.height, 1);
  rendering.colour = Image(camera.width, camera.height, 3);
  const Eigen::Matrix3d R_C_O = view.T_O_C.R.transpose();
  const Eigen::Vector3d centre_C = R_C_O * (keyframe.centre - view.T_O_C.t);
  const int none = level.width * level.height;
  for (int i = 0; i < level.shown.size(); ++i) {
    if (level.shown.cell[i] == none) continue;
    const Eigen::Vector3d point(level.shown.x[i], level.shown.y[i], level.shown.z[i]);
    const Eigen::Vector3d p_C = R_C_O * point + centre_C;
    if (!(p_C.z() > 0)) continue;
    spread(camera.project(p_C), reach,
           {level.shown_colour[0][i], level.shown_colour[1][i], level.shown_colour[2][i]},
           &rendering);
  }
  normalise(&rendering);
  return rendering;
}

}  // namespace nerf_pose_refiner
