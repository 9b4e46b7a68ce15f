// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/outline_sums.h"

#include <cmath>

namespace nerf_pose_refiner {
namespace {

Vec3<float> plain(const Eigen::Vector3f& v) { return {v.x(), v.y(), v.z()}; }

// False: a place lies outside of the image, or shows nothing.
bool sampleProfile(const KernelImage& image, const Pixel<float>& middle, const Pixel<float>& step,
                   OutlineProfile* profile) {
  constexpr float kSeen = 0.99f;
  for (int i = 0; i < kOutlinePlaces; ++i) {
    const auto s = static_cast<float>(i - kOutlineReach);
    const float u = middle.u + s * step.u, v = middle.v + s * step.v;
    if (!(u >= 0 && v >= 0 && u < static_cast<float>(image.width - 1) &&
          v < static_cast<float>(image.height - 1))) {
      return false;
    }
    const int x = static_cast<int>(u), y = static_cast<int>(v);
    const float fu = u - static_cast<float>(x), fv = v - static_cast<float>(y);
    const float* upper = image.pixels + 4 * (static_cast<std::ptrdiff_t>(y) * image.width + x);
    const float* lower = upper + 4 * image.width;
    float value[4];
    for (int c = 0; c < 4; ++c) {
      value[c] = (1 - fv) * ((1 - fu) * upper[c] + fu * upper[4 + c]) +
                 fv * ((1 - fu) * lower[c] + fu * lower[4 + c]);
    }
    if (value[3] < kSeen) return false;
    for (int c = 0; c < 3; ++c) profile->colour[i][c] = value[c];
  }
  return true;
}

}  // namespace

int sumOutline(const KernelView& view, const OutlineTile& tile, const OutlineRules& rules,
               PointSums<float>* sums) {
  int seen = 0;
  const Pinhole<float>& K = view.image.K;
  for (int i = tile.first; i < tile.last; ++i) {
    const OutlinePoint& place = tile.level.outline[i];
    const Vec3<float> p = plain(place.point), q = inCamera(view.pose, p);
    const Vec3<float> beside = inCamera(view.pose, p + plain(place.normal));
    if (!(q.z > 0 && beside.z > 0)) continue;
    const Pixel<float> middle = project(K, q), end = project(K, beside);
    const Pixel<float> step = {end.u - middle.u, end.v - middle.v};
    const float squared = step.u * step.u + step.v * step.v;
    if (!(squared > 0.1f)) continue;  // seen from the side: not what the keyframe's outline is
    OutlineProfile profile;
    if (!sampleProfile(view.image, middle, step, &profile)) continue;
    const PixelFlow<float> flow = pointFlow(K, view.pose, p, q);
    float along[6];  // the normal, in pixels of the keyframe
    for (int k = 0; k < 6; ++k) along[k] = (step.u * flow.u[k] + step.v * flow.v[k]) / squared;
    addOutlinePoint(place.opacity, outlineOpacities(profile), along, rules, sums);
    ++seen;
  }
  return seen;
}

}  // namespace nerf_pose_refiner
