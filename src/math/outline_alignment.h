// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/host_device.h"
#include "math/keyframe_alignment.h"
#include "math/keyframe_evidence.h"
#include "math/robust.h"

namespace nerf_pose_refiner {

// Alignment of an object's outline with an image in which nothing is known of the colours on either
// side. Along the outline's normal the image goes over from what it shows just inside to what it
// shows just outside: where between the two colours a pixel lies is the object's opacity as the
// image shows it. Light and background have no part in that, as long as the two sides differ. Where
// the object's own colour changes towards its outline, as a round body's shading does, the colours
// lie elsewhere between the two: the keyframe tells by how much.

/// Places along the normal, in pixels of the keyframe, -kOutlineReach..kOutlineReach: the two
/// outermost on each side give the colours of that side, the others are compared.
constexpr int kOutlineReach = 3;
constexpr int kOutlinePlaces = 2 * kOutlineReach + 1;
constexpr int kOutlineCompared = 2;  ///< places -2..2
constexpr int kOutlineOpacities = 2 * kOutlineCompared + 1;

/// Colours that differ by less show no outline.
constexpr float kOutlineContrast = 0.06f;
/// Residuals of opacity are multiplied by it before they meet the robust loss of colours.
constexpr float kOutlineScale = 2;
/// Places of less weight in the image show nothing.
constexpr float kOutlineSeen = 0.99f;
/// Squared residual, so scaled, where the image shows no such outline.
constexpr float kOutlineChance = 0.16f * kOutlineScale * kOutlineScale;

/// What a keyframe shows along the normal of an outline, from the inside to the outside.
struct OutlineLook {
  float opacity[kOutlineOpacities];
  float shade[kOutlineOpacities][3];  ///< the object's colour over that just inside
};

/// What an image shows along the normal of an outline.
struct OutlineProfile {
  float colour[kOutlinePlaces][3];  ///< from the inside to the outside
};

/// The opacities that a profile shows, and how much they are worth.
struct OutlineOpacities {
  float value[kOutlineOpacities];
  float weight;         ///< 0..1: 0 where both sides have the same colour
  float outside[3];     ///< the colour of that side
  float difference[3];  ///< the colour just inside, less that
  float per_squared;    ///< 1 / |difference|^2, bounded
};

/// Where a colour lies between those of the two sides, as opacity.
NPR_HOST_DEVICE inline float opacityOf(const float colour[3], const OutlineOpacities& sides) {
  float along = 0;
  for (int c = 0; c < 3; ++c) along += sides.difference[c] * (colour[c] - sides.outside[c]);
  return sides.per_squared * along;
}

NPR_HOST_DEVICE inline OutlineOpacities outlineOpacities(const OutlineProfile& profile) {
  OutlineOpacities opacities;
  float squared = 0;
  for (int c = 0; c < 3; ++c) {
    const float inside = 0.5f * (profile.colour[0][c] + profile.colour[1][c]);
    opacities.outside[c] =
        0.5f * (profile.colour[kOutlinePlaces - 1][c] + profile.colour[kOutlinePlaces - 2][c]);
    opacities.difference[c] = inside - opacities.outside[c];
    squared += opacities.difference[c] * opacities.difference[c];
  }
  constexpr float kFlat = kOutlineContrast * kOutlineContrast;
  opacities.weight = squared / (squared + kFlat);
  opacities.per_squared = 1 / (squared + 0.1f * kFlat);
  for (int i = 0; i < kOutlineOpacities; ++i) {
    opacities.value[i] = opacityOf(profile.colour[kOutlineReach - kOutlineCompared + i], opacities);
  }
  return opacities;
}

/// The opacities that an image with these sides would show of what a keyframe shows, before such a
/// background and in such light.
NPR_HOST_DEVICE inline void expectedOpacities(const OutlineLook& rendered,
                                              const OutlineOpacities& sides,
                                              float expected[kOutlineOpacities]) {
  for (int i = 0; i < kOutlineOpacities; ++i) {
    float colour[3];
    for (int c = 0; c < 3; ++c) {
      colour[c] = rendered.shade[i][c] * (sides.outside[c] + sides.difference[c]);
    }
    expected[i] = rendered.opacity[i] * opacityOf(colour, sides);
  }
}

/// Where the image shows a point of an outline.
struct OutlineInImage {
  Vec3<float> q;  ///< in C
  Pixel<float> middle;
  Pixel<float> step;  ///< along the normal that points outside, a pixel of the keyframe
};

/// @param p relative to the object's centre, in the axes of O. @param normal a pixel of the
/// keyframe to the outside, alike.
/// @return false: the point lies behind the camera, or its normal is seen end-on.
NPR_HOST_DEVICE inline bool placeOutline(const Pinhole<float>& K, const PointTransform<float>& pose,
                                         const Vec3<float>& p, const Vec3<float>& normal,
                                         OutlineInImage* place) {
  constexpr float kEndOn = 0.1f;  // squared length of the step [px^2]
  place->q = inCamera(pose, p);
  const Vec3<float> beside = inCamera(pose, p + normal);
  if (!(place->q.z > 0 && beside.z > 0)) return false;
  const Pixel<float> end = project(K, beside);
  place->middle = project(K, place->q);
  place->step = {end.u - place->middle.u, end.v - place->middle.v};
  return place->step.u * place->step.u + place->step.v * place->step.v > kEndOn;
}

/// How the image flows along the normal when the camera moves [px of the keyframe].
NPR_HOST_DEVICE inline void flowAlongNormal(const Pinhole<float>& K,
                                            const PointTransform<float>& pose, const Vec3<float>& p,
                                            const OutlineInImage& place, float along[6]) {
  const PixelFlow<float> flow = pointFlow(K, pose, p, place.q);
  const float squared = place.step.u * place.step.u + place.step.v * place.step.v;
  for (int k = 0; k < 6; ++k) {
    along[k] = (place.step.u * flow.u[k] + place.step.v * flow.v[k]) / squared;
  }
}

/// How points of an outline are summed.
struct OutlineRules {
  float robust_scale;
  float weight;  ///< of a point, beside one of the inside
};

/// Adds a point of the outline.
/// @param rendered how the keyframe shows it. @param flow of the image along the normal that
/// points outside, for motions of the camera [px of the keyframe].
NPR_HOST_DEVICE inline void addOutlinePoint(const OutlineLook& rendered,
                                            const OutlineOpacities& observed, const float flow[6],
                                            const OutlineRules& rules, PointSums<float>* sums) {
  float expected[kOutlineOpacities];
  expectedOpacities(rendered, observed, expected);
  const float share = rules.weight / kOutlineOpacities, scale = rules.robust_scale;
  const float chance = gemanMcClure(kOutlineChance, scale).value;
  for (int i = 0; i < kOutlineOpacities; ++i) {
    const float r = kOutlineScale * (expected[i] - observed.value[i]);
    const int before = i > 0 ? i - 1 : i, after = i + 1 < kOutlineOpacities ? i + 1 : i;
    const float per_px = kOutlineScale / static_cast<float>(after - before);
    // The mean of the expected and the observed slope, as of colours.
    const float slope =
        0.5f * per_px *
        (expected[after] - expected[before] + observed.value[after] - observed.value[before]);
    const float weight = share * observed.weight;
    const RobustTerm<float> robust = gemanMcClure(r * r, scale);
    const float w = weight * robust.weight;
    sums->weight += weight;
    // Where there is no outline to be seen, leaving it is no gain.
    sums->cost += weight * robust.value + (share - weight) * chance;
    sums->robust_weight += w;
    sums->squared_residual += w * r * r;
    float* entry = sums->information;
    for (int a = 0; a < 6; ++a) {
      const float g = w * slope * slope * flow[a];
      for (int b = 0; b <= a; ++b) *entry++ += g * flow[b];
      sums->gradient[a] += w * slope * r * flow[a];
    }
  }
}

/// Adds what a point of the outline says for a pose.
NPR_HOST_DEVICE inline void addOutlineEvidence(const OutlineLook& rendered,
                                               const OutlineOpacities& observed,
                                               const OutlineRules& rules,
                                               EvidenceSums<float>* sums) {
  float expected[kOutlineOpacities];
  expectedOpacities(rendered, observed, expected);
  const float weight = rules.weight / kOutlineOpacities * observed.weight;
  for (int i = 0; i < kOutlineOpacities; ++i) {
    const float r = kOutlineScale * (expected[i] - observed.value[i]);
    sums->explained += weight * gemanMcClure(r * r, rules.robust_scale).value;
    sums->chance += weight * gemanMcClure(kOutlineChance, rules.robust_scale).value;
    sums->weight += weight;
  }
}

}  // namespace nerf_pose_refiner
