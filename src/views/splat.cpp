// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/splat.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace nerf_pose_refiner {
namespace {

/// The coarsest level that has at least a point a pixel.
const KeyframeLevel& levelFor(const KeyframePoints& keyframe, const View& view) {
  const double distance = (keyframe.centre - view.T_O_C.t).norm();
  const double own_distance = (keyframe.centre - keyframe.T_O_C.t).norm();
  const double pixels = keyframe.camera.fx / keyframe.reduction / own_distance /
                        (view.camera.fx / distance);  // of the first level, along one of the view
  std::size_t level = 0;
  while (level + 1 < keyframe.levels.size()) {
    const int next = keyframe.levels[level + 1].spacing << (level + 1);
    if (next > pixels) break;
    ++level;
  }
  return keyframe.levels[level];
}

/// Adds a point to the four pixels around a place, as much as each is near.
void spread(const Eigen::Vector2d& place, const Eigen::Array3f& colour, Rendering* rendering) {
  const int width = rendering->alpha.width, height = rendering->alpha.height;
  const Eigen::Vector2d corner(std::floor(place.x()), std::floor(place.y()));
  if (corner.x() < -1 || corner.y() < -1 || corner.x() >= width || corner.y() >= height) return;
  for (int dy = 0; dy < 2; ++dy) {
    for (int dx = 0; dx < 2; ++dx) {
      const int x = static_cast<int>(corner.x()) + dx, y = static_cast<int>(corner.y()) + dy;
      if (x < 0 || y < 0 || x >= width || y >= height) continue;
      const auto weight =
          static_cast<float>((1 - std::abs(place.x() - x)) * (1 - std::abs(place.y() - y)));
      rendering->alpha.at(x, y, 0) += weight;
      Eigen::Map<Eigen::Array3f>(rendering->colour.pixel(x, y)) += weight * colour;
    }
  }
}

/// Makes sums of weighted colours colours, where there is enough of them.
void normalise(Rendering* rendering) {
  constexpr float kCovered = 0.5f;  // points: fewer are the rim, or a gap
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
  const KeyframeLevel& level = levelFor(keyframe, view);
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
    spread(camera.project(p_C),
           {level.shown_colour[0][i], level.shown_colour[1][i], level.shown_colour[2][i]},
           &rendering);
  }
  normalise(&rendering);
  return rendering;
}

}  // namespace nerf_pose_refiner
