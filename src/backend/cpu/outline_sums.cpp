// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/outline_sums.h"

#include <cmath>

namespace nerf_pose_refiner {
namespace {

Vec3<float> plain(const Eigen::Vector3f& v) { return {v.x(), v.y(), v.z()}; }

// False: a place lies outside of the image, or shows nothing.
bool sampleProfile(const KernelImage& image, const OutlineInImage& place, OutlineProfile* profile) {
  for (int i = 0; i < kOutlinePlaces; ++i) {
    const auto s = static_cast<float>(i - kOutlineReach);
    const float u = place.middle.u + s * place.step.u, v = place.middle.v + s * place.step.v;
    if (!(u >= 0 && v >= 0 && u < static_cast<float>(image.width - 1) &&
          v < static_cast<float>(image.height - 1))) {
      return false;
    }
    const int x = static_cast<int>(u), y = static_cast<int>(v);
    const float fu = u - static_cast<float>(x), fv = v - static_cast<float>(y);
    const float* upper = image.pixels + 4 * (static_cast<std::ptrdiff_t>(y) * image.row_pixels + x);
    const float* lower = upper + 4 * image.row_pixels;
    float value[4];
    for (int c = 0; c < 4; ++c) {
      value[c] = (1 - fv) * ((1 - fu) * upper[c] + fu * upper[4 + c]) +
                 fv * ((1 - fu) * lower[c] + fu * lower[4 + c]);
    }
    if (value[3] < kOutlineSeen) return false;
    for (int c = 0; c < 3; ++c) profile->colour[i][c] = value[c];
  }
  return true;
}

// A point of the outline in the frame.
struct SeenOutline {
  OutlineInImage place;
  OutlineOpacities opacities;  // as the frame shows them
};

// False: its normal leaves the image, or what has weight in it, or is seen end-on.
bool look(const KernelView& view, const OutlinePoint& point, SeenOutline* seen) {
  OutlineProfile profile;
  if (!placeOutline(view.image.K, view.pose, plain(point.point), plain(point.normal),
                    &seen->place) ||
      !sampleProfile(view.image, seen->place, &profile)) {
    return false;
  }
  seen->opacities = outlineOpacities(profile);
  return true;
}

}  // namespace

int sumOutline(const KernelView& view, const OutlineTile& tile, const OutlineRules& rules,
               PointSums<float>* sums) {
  int count = 0;
  SeenOutline seen;
  for (int i = tile.first; i < tile.last; ++i) {
    const OutlinePoint& point = tile.level.outline[i];
    if (!look(view, point, &seen)) continue;
    float along[6];
    flowAlongNormal(view.image.K, view.pose, plain(point.point), seen.place, along);
    addOutlinePoint(point.look, seen.opacities, along, rules, sums);
    ++count;
  }
  return count;
}

void sumOutlineEvidence(const KernelView& view, const OutlineTile& tile, const OutlineRules& rules,
                        EvidenceSums<float>* sums) {
  SeenOutline seen;
  for (int i = tile.first; i < tile.last; ++i) {
    const OutlinePoint& point = tile.level.outline[i];
    if (look(view, point, &seen)) addOutlineEvidence(point.look, seen.opacities, rules, sums);
  }
}

}  // namespace nerf_pose_refiner
