// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "math/host_device.h"
#include "math/vec.h"

namespace nerf_pose_refiner {

// Alignment of an object's surface with a depth image. A pixel's depth is compared with that of the
// surface's tangent plane on the pixel's own ray: no interpolation between pixels, and none of the
// measured depth's noise in derivatives.

/// A place of the surface with its normal, which may have any length.
template <typename T>
struct SurfacePlace {
  Vec3<T> p;  ///< relative to the object's centre, in the axes of O [model units]
  Vec3<T> n;  ///< in the axes of O
};

/// Depth of a tangent plane on a ray, and how it changes when the camera moves.
template <typename T>
struct PlaneDepth {
  T depth;
  T slope;        ///< by which the depth changes with the ray's slope, at most: across the surface
  T jacobian[6];  ///< for motions (v, w) of the camera as in moveCamera
};

/// @param q the place in the depth camera D, @see inCamera. @param R of the pose: D to O.
/// @param ray through the pixel, in D, z = 1.
/// @return false: the plane is seen edge-on or from behind.
///
/// The plane n . (x - q) = 0 meets the ray at depth s = n . q / n . ray. Moving the camera by
/// (v, w) moves the surface's point X there by -R^T (v + w x p_X), and the plane's depth on the ray
/// by n . dX / n . ray.
template <typename T>
NPR_HOST_DEVICE inline bool planeDepth(const SurfacePlace<T>& place, const Vec3<T>& q,
                                       const Mat3<T>& R, const Vec3<T>& ray, PlaneDepth<T>* out) {
  constexpr T kMinCosine = T(0.2);
  const Vec3<T> n = transposedTimes(R, place.n);
  const T along = dot(n, ray);
  if (!(-along > kMinCosine * norm(n) * norm(ray))) return false;
  out->depth = dot(n, q) / along;
  out->slope = std::abs(out->depth / along) * std::sqrt(n.x * n.x + n.y * n.y);
  const Vec3<T> p = place.p + R * (out->depth * ray - q);
  const Vec3<T> turn = cross(p, place.n);  // n . (w x p) = w . (p x n)
  const T scale = -1 / along;
  out->jacobian[0] = scale * place.n.x;
  out->jacobian[1] = scale * place.n.y;
  out->jacobian[2] = scale * place.n.z;
  out->jacobian[3] = scale * turn.x;
  out->jacobian[4] = scale * turn.y;
  out->jacobian[5] = scale * turn.z;
  return true;
}

}  // namespace nerf_pose_refiner
