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

/// What a keyframe shows along the normal of an outline, from the inside to the outside. T is a
/// number or a vector of numbers, one of each point, here and below: nothing branches.
template <typename T>
struct OutlineLook {
  T opacity[kOutlineOpacities];
  T shade[kOutlineOpacities][3];  ///< the object's colour over that just inside
};

/// What an image shows along the normal of an outline.
template <typename T>
struct OutlineProfile {
  T colour[kOutlinePlaces][3];  ///< from the inside to the outside
};

/// The opacities that a profile shows, and how much they are worth.
template <typename T>
struct OutlineOpacities {
  T value[kOutlineOpacities];
  T weight;         ///< 0..1: 0 where both sides have the same colour
  T outside[3];     ///< the colour of that side
  T difference[3];  ///< the colour just inside, less that
  T per_squared;    ///< 1 / |difference|^2, bounded
};

/// Where a colour lies between those of the two sides, as opacity.
template <typename T>
NPR_HOST_DEVICE inline T opacityOf(const T colour[3], const OutlineOpacities<T>& sides) {
  T along = sides.difference[0] * (colour[0] - sides.outside[0]);
  for (int c = 1; c < 3; ++c) along += sides.difference[c] * (colour[c] - sides.outside[c]);
  return sides.per_squared * along;
}

template <typename T>
NPR_HOST_DEVICE inline OutlineOpacities<T> outlineOpacities(const OutlineProfile<T>& profile) {
  OutlineOpacities<T> opacities;
  T squared = {};
  for (int c = 0; c < 3; ++c) {
    const T inside = 0.5f * (profile.colour[0][c] + profile.colour[1][c]);
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
template <typename T>
NPR_HOST_DEVICE inline void expectedOpacities(const OutlineLook<T>& rendered,
                                              const OutlineOpacities<T>& sides,
                                              T expected[kOutlineOpacities]) {
  for (int i = 0; i < kOutlineOpacities; ++i) {
    T colour[3];
    for (int c = 0; c < 3; ++c) {
      colour[c] = rendered.shade[i][c] * (sides.outside[c] + sides.difference[c]);
    }
    expected[i] = rendered.opacity[i] * opacityOf(colour, sides);
  }
}

/// Where the image shows a point of an outline; without meaning if it is not in sight.
template <typename T>
struct OutlineInImage {
  Vec3<T> q;       ///< in C
  T depth_beside;  ///< of the place beside it along the normal, in C
  Pixel<T> middle;
  Pixel<T> step;  ///< along the normal that points outside, a pixel of the keyframe

  NPR_HOST_DEVICE T squaredStep() const { return step.u * step.u + step.v * step.v; }

  /// Whether it lies before the camera, and its normal is not seen end-on: a number that is 0 where
  /// not, or a mask.
  NPR_HOST_DEVICE auto isInSight() const {
    constexpr float kEndOn = 0.1f;  // squared length of the step [px^2]
    return (q.z > 0.0f) & (depth_beside > 0.0f) & (squaredStep() > kEndOn);
  }
};

/// @param p relative to the object's centre, in the axes of O. @param normal a pixel of the
/// keyframe to the outside, alike.
template <typename S, typename T>
NPR_HOST_DEVICE inline OutlineInImage<T> placeOutline(const Pinhole<S>& K,
                                                      const PointTransform<S>& pose,
                                                      const Vec3<T>& p, const Vec3<T>& normal) {
  OutlineInImage<T> place;
  place.q = inCamera(pose, p);
  const Vec3<T> beside = inCamera(pose, p + normal);
  place.depth_beside = beside.z;
  const T inverse_depth = 1 / place.q.z, inverse_beside = 1 / beside.z;
  place.middle = {K.fx * place.q.x * inverse_depth + K.cx, K.fy * place.q.y * inverse_depth + K.cy};
  place.step = {K.fx * beside.x * inverse_beside + K.cx - place.middle.u,
                K.fy * beside.y * inverse_beside + K.cy - place.middle.v};
  return place;
}

/// How the image flows along the normal when the camera moves [px of the keyframe].
template <typename S, typename T>
NPR_HOST_DEVICE inline void flowAlongNormal(const Pinhole<S>& K, const PointTransform<S>& pose,
                                            const Vec3<T>& p, const OutlineInImage<T>& place,
                                            T along[6]) {
  const PixelFlow<T> flow = pointFlow(K, pose, p, place.q);
  const T inverse_squared = 1 / place.squaredStep();
  for (int k = 0; k < 6; ++k) {
    along[k] = (place.step.u * flow.u[k] + place.step.v * flow.v[k]) * inverse_squared;
  }
}

/// How points of an outline are summed.
template <typename T>
struct OutlineRules {
  T robust_scale;
  T weight;  ///< of a point, beside one of the inside; 0 for one that is not seen
};

/// Adds a point of the outline.
/// @param rendered how the keyframe shows it. @param flow of the image along the normal that
/// points outside, for motions of the camera [px of the keyframe].
template <typename T>
NPR_HOST_DEVICE inline void addOutlinePoint(const OutlineLook<T>& rendered,
                                            const OutlineOpacities<T>& observed, const T flow[6],
                                            const OutlineRules<T>& rules, PointSums<T>* sums) {
  T expected[kOutlineOpacities];
  expectedOpacities(rendered, observed, expected);
  const T share = rules.weight / static_cast<float>(kOutlineOpacities);
  const T weight = share * observed.weight;
  // All opacities move along the same flow: it is multiplied by what they have in common once.
  T cost = {}, robust_weight = {}, squared = {}, curvature = {}, pull = {};
  for (int i = 0; i < kOutlineOpacities; ++i) {
    const T r = kOutlineScale * (expected[i] - observed.value[i]);
    const int before = i > 0 ? i - 1 : i, after = i + 1 < kOutlineOpacities ? i + 1 : i;
    const float per_px = kOutlineScale / static_cast<float>(after - before);
    // The mean of the expected and the observed slope, as of colours.
    const T slope =
        0.5f * per_px *
        (expected[after] - expected[before] + observed.value[after] - observed.value[before]);
    const RobustTerm<T> robust = gemanMcClure(r * r, rules.robust_scale);
    cost += robust.value;
    robust_weight += robust.weight;
    squared += robust.weight * r * r;
    curvature += robust.weight * slope * slope;
    pull += robust.weight * slope * r;
  }
  const T chance = gemanMcClure(T{} + kOutlineChance, rules.robust_scale).value;
  constexpr auto kCount = static_cast<float>(kOutlineOpacities);
  sums->weight += kCount * weight;
  // Where there is no outline to be seen, leaving it is no gain.
  sums->cost += weight * cost + kCount * (share - weight) * chance;
  sums->robust_weight += weight * robust_weight;
  sums->squared_residual += weight * squared;
  T* entry = sums->information;
  for (int a = 0; a < 6; ++a) {
    const T g = weight * curvature * flow[a];
    for (int b = 0; b <= a; ++b) *entry++ += g * flow[b];
    sums->gradient[a] += weight * pull * flow[a];
  }
}

/// Adds what a point of the outline says for a pose.
template <typename T>
NPR_HOST_DEVICE inline void addOutlineEvidence(const OutlineLook<T>& rendered,
                                               const OutlineOpacities<T>& observed,
                                               const OutlineRules<T>& rules,
                                               EvidenceSums<T>* sums) {
  T expected[kOutlineOpacities];
  expectedOpacities(rendered, observed, expected);
  const T weight = rules.weight * observed.weight;
  T explained = {};
  for (int i = 0; i < kOutlineOpacities; ++i) {
    const T r = kOutlineScale * (expected[i] - observed.value[i]);
    explained += gemanMcClure(r * r, rules.robust_scale).value;
  }
  sums->explained += weight / static_cast<float>(kOutlineOpacities) * explained;
  sums->chance += weight * gemanMcClure(T{} + kOutlineChance, rules.robust_scale).value;
  sums->weight += weight;
}

}  // namespace nerf_pose_refiner
