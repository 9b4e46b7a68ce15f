// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/depth_surface.h"

#include <algorithm>
#include <cmath>

#include "backend/common/plain_pose.h"
#include "math/tile_scatter.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kFewestShown = 60;
constexpr double kMinFacing = 0.25;  // cosine to the line of sight

class SurfaceMaker {
 public:
  SurfaceMaker(const KeyframePoints& keyframe, int max_places)
      : max_places_(max_places),
        level_(keyframe.levels.front()),
        at_(static_cast<std::size_t>(level_.width) * level_.height, -1),
        eye_(plainVector(keyframe.T_O_C.t - keyframe.centre)) {
    const int none = level_.width * level_.height;
    for (int i = 0; i < level_.shown.size(); ++i) {
      if (level_.shown.cell[i] < none) at_[level_.shown.cell[i]] = i;
    }
  }

  DepthSurface make() {
    const auto known = std::count_if(at_.begin(), at_.end(), [](int i) { return i >= 0; });
    if (known < kFewestShown) return {};
    const int stride =
        static_cast<int>(std::ceil(std::sqrt(static_cast<double>(known) / max_places_)));
    double width = 0;
    for (int y = 1; y + 1 < level_.height; y += stride) {
      for (int x = 1; x + 1 < level_.width; x += stride) width += add(x, y);
    }
    if (surface_.places.empty()) return {};
    const double cell = width / static_cast<double>(surface_.places.size());
    surface_.spacing = stride * cell;
    surface_.shown = &level_.shown;
    surface_.shown_spacing = level_.spacing;
    surface_.shown_px = cell / level_.spacing;
    surface_.tiles = tilesAcross() * (level_.height * level_.spacing / kTileSide + 1);
    addOutline();
    return std::move(surface_);
  }

 private:
  int tilesAcross() const { return level_.width * level_.spacing / kTileSide + 1; }

  Vec3<double> pointAt(int i) const {
    return {level_.shown.x[i], level_.shown.y[i], level_.shown.z[i]};
  }

  /// Adds the place of a cell, if it has all its neighbours. @return the cell's width across the
  /// line of sight [model units], 0 if it was not added.
  double add(int x, int y) {
    Vec3<double> right = {0, 0, 0}, down = {0, 0, 0};
    for (int v = -1; v <= 1; ++v) {
      for (int u = -1; u <= 1; ++u) {
        const int i = at_[(y + v) * level_.width + x + u];
        if (i < 0) return 0;
        right += static_cast<double>(u) * pointAt(i);
        down += static_cast<double>(v) * pointAt(i);
      }
    }
    const int cell = y * level_.width + x;
    const Vec3<double> p = pointAt(at_[cell]);
    const Vec3<double> n = cross(down, right), to_eye = eye_ - p;
    if (!(dot(n, to_eye) > kMinFacing * norm(n) * norm(to_eye))) return 0;
    surface_.places.push_back({p, normalized(n)});
    surface_.cell.push_back(cell);
    surface_.tile.push_back(y * level_.spacing / kTileSide * tilesAcross() +
                            x * level_.spacing / kTileSide);
    constexpr double kSteps = 6;  // of a cell, that the sums hold
    const Vec3<double> sight = normalized(to_eye);
    return norm(right - dot(right, sight) * sight) / kSteps;
  }

  void addOutline() {
    const std::vector<std::int32_t>& begins = level_.outline_tiles;
    std::size_t tile = 0;
    for (std::size_t i = 0; i < level_.outline.size(); ++i) {
      while (tile + 2 < begins.size() && static_cast<std::size_t>(begins[tile + 1]) <= i) ++tile;
      const OutlinePoint& at = level_.outline[i];
      surface_.outline.push_back({plainVector(at.point.cast<double>().eval()),
                                  plainVector(at.normal.cast<double>().eval())});
      surface_.outline_tile.push_back(surface_.tiles + static_cast<std::int32_t>(tile));
    }
    surface_.tiles += static_cast<int>(tile) + 1;
  }

  const int max_places_;
  const KeyframeLevel& level_;
  std::vector<int> at_;  // of each cell: its place among the shown points; -1: none
  Vec3<double> eye_;     // relative to the object's centre
  DepthSurface surface_;
};

}  // namespace

DepthSurface depthSurfaceOf(const KeyframePoints& keyframe, int max_places) {
  return SurfaceMaker(keyframe, max_places).make();
}

}  // namespace nerf_pose_refiner
