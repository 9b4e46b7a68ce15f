// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/host_device.h"

namespace nerf_pose_refiner {

/// Real spherical harmonics of a unit direction up to degree 1..4: out[degree^2], bands in order,
/// m = -l..l within a band, Condon-Shortley phase included.
template <typename T>
NPR_HOST_DEVICE inline void sphericalHarmonics(const T direction[3], int degree, T* out) {
  const T x = direction[0], y = direction[1], z = direction[2];
  out[0] = T(0.28209479177387814);
  if (degree < 2) return;
  out[1] = T(-0.48860251190291987) * y;
  out[2] = T(0.48860251190291987) * z;
  out[3] = T(-0.48860251190291987) * x;
  if (degree < 3) return;
  const T x2 = x * x, y2 = y * y, z2 = z * z;
  out[4] = T(1.0925484305920792) * x * y;
  out[5] = T(-1.0925484305920792) * y * z;
  out[6] = T(0.94617469575755997) * z2 - T(0.31539156525251999);
  out[7] = T(-1.0925484305920792) * x * z;
  out[8] = T(0.54627421529603959) * (x2 - y2);
  if (degree < 4) return;
  out[9] = T(0.59004358992664352) * y * (T(-3) * x2 + y2);
  out[10] = T(2.8906114426405538) * x * y * z;
  out[11] = T(0.45704579946446572) * y * (T(1) - T(5) * z2);
  out[12] = T(0.3731763325901154) * z * (T(5) * z2 - T(3));
  out[13] = T(0.45704579946446572) * x * (T(1) - T(5) * z2);
  out[14] = T(1.4453057213202769) * z * (x2 - y2);
  out[15] = T(0.59004358992664352) * x * (-x2 + T(3) * y2);
}

/// Gradient of sum_k weight[k] * out[k] with respect to the direction's three numbers, taken as
/// free variables of the polynomials above; added to gradient[3].
template <typename T>
NPR_HOST_DEVICE inline void sphericalHarmonicsGradient(const T direction[3], int degree,
                                                       const T* weight, T* gradient) {
  const T x = direction[0], y = direction[1], z = direction[2];
  if (degree < 2) return;
  gradient[0] += T(-0.48860251190291987) * weight[3];
  gradient[1] += T(-0.48860251190291987) * weight[1];
  gradient[2] += T(0.48860251190291987) * weight[2];
  if (degree < 3) return;
  const T a = T(1.0925484305920792);
  const T b = T(2 * 0.54627421529603959);
  gradient[0] += a * (y * weight[4] - z * weight[7]) + b * x * weight[8];
  gradient[1] += a * (x * weight[4] - z * weight[5]) - b * y * weight[8];
  gradient[2] += T(2 * 0.94617469575755997) * z * weight[6] - a * (y * weight[5] + x * weight[7]);
  if (degree < 4) return;
  const T x2 = x * x, y2 = y * y, z2 = z * z;
  const T c = T(3 * 0.59004358992664352), d = T(2.8906114426405538), e = T(0.45704579946446572);
  const T f = T(3 * 0.3731763325901154), g = T(1.4453057213202769);
  gradient[0] += c * (T(-2) * x * y * weight[9] + (y2 - x2) * weight[15]) + d * y * z * weight[10] +
                 e * (T(1) - T(5) * z2) * weight[13] + T(2) * g * x * z * weight[14];
  gradient[1] += c * ((y2 - x2) * weight[9] + T(2) * x * y * weight[15]) + d * x * z * weight[10] +
                 e * (T(1) - T(5) * z2) * weight[11] - T(2) * g * y * z * weight[14];
  gradient[2] += d * x * y * weight[10] - T(10) * e * z * (y * weight[11] + x * weight[13]) +
                 f * (T(5) * z2 - T(1)) * weight[12] + g * (x2 - y2) * weight[14];
}

}  // namespace nerf_pose_refiner
