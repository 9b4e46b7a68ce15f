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

// A point of the outline in the frame.
struct SeenOutline {
  Vec3<float> p, q;            // relative to the object's centre in O; in C
  Pixel<float> step;           // along the normal, a pixel of the keyframe
  OutlineOpacities opacities;  // as the frame shows them
};

// False: its normal leaves the image, or what has weight in it, or is seen end-on.
bool look(const KernelView& view, const OutlinePoint& place, SeenOutline* seen) {
  constexpr float kEndOn = 0.1f;  // squared length of the step [px^2]
  const Pinhole<float>& K = view.image.K;
  seen->p = plain(place.point);
  seen->q = inCamera(view.pose, seen->p);
  const Vec3<float> beside = inCamera(view.pose, seen->p + plain(place.normal));
  if (!(seen->q.z > 0 && beside.z > 0)) return false;
  const Pixel<float> middle = project(K, seen->q), end = project(K, beside);
  seen->step = {end.u - middle.u, end.v - middle.v};
  if (!(seen->step.u * seen->step.u + seen->step.v * seen->step.v > kEndOn)) return false;
  OutlineProfile profile;
  if (!sampleProfile(view.image, middle, seen->step, &profile)) return false;
  seen->opacities = outlineOpacities(profile);
  return true;
}

}  // namespace

int sumOutline(const KernelView& view, const OutlineTile& tile, const OutlineRules& rules,
               PointSums<float>* sums) {
  int count = 0;
  SeenOutline seen;
  for (int i = tile.first; i < tile.last; ++i) {
    const OutlinePoint& place = tile.level.outline[i];
    if (!look(view, place, &seen)) continue;
    const PixelFlow<float> flow = pointFlow(view.image.K, view.pose, seen.p, seen.q);
    const float squared = seen.step.u * seen.step.u + seen.step.v * seen.step.v;
    float along[6];  // the normal, in pixels of the keyframe
    for (int k = 0; k < 6; ++k) {
      along[k] = (seen.step.u * flow.u[k] + seen.step.v * flow.v[k]) / squared;
    }
    addOutlinePoint(place.opacity, seen.opacities, along, rules, sums);
    ++count;
  }
  return count;
}

void sumOutlineEvidence(const KernelView& view, const OutlineTile& tile, const OutlineRules& rules,
                        EvidenceSums<float>* sums) {
  SeenOutline seen;
  for (int i = tile.first; i < tile.last; ++i) {
    const OutlinePoint& place = tile.level.outline[i];
    if (look(view, place, &seen)) addOutlineEvidence(place.opacity, seen.opacities, rules, sums);
  }
}

}  // namespace nerf_pose_refiner
