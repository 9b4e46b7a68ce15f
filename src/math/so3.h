// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "math/vec.h"

namespace nerf_pose_refiner {

/// Rotation exp([w]_x) about w by |w| radians (Rodrigues):
/// I + sin(a)/a [w]_x + (1 - cos(a))/a^2 [w]_x^2 with a = |w|.
template <typename T>
NPR_HOST_DEVICE inline Mat3<T> expSO3(const Vec3<T>& w) {
  const T half = norm(w) / 2;
  const T sine = std::sin(half);
  const T half_sinc = half > 0 ? sine / half : T(1);
  const T sinc = half_sinc * std::cos(half);
  // (1 - cos(a))/a^2, written so that nothing cancels near 0.
  const T b = half_sinc * half_sinc / 2;
  const T c = 1 - 2 * sine * sine;
  return {{{c + b * w.x * w.x, b * w.x * w.y - sinc * w.z, b * w.x * w.z + sinc * w.y},
           {b * w.y * w.x + sinc * w.z, c + b * w.y * w.y, b * w.y * w.z - sinc * w.x},
           {b * w.z * w.x - sinc * w.y, b * w.z * w.y + sinc * w.x, c + b * w.z * w.z}}};
}

/// Rotation vector of R, |w| in [0, pi]; the inverse of expSO3, also near 0 and near pi.
///
/// Goes through the quaternion of R, from whichever of its components is largest (Shepperd 1978),
/// so that no accuracy is lost where the trace is near 3 or near -1.
template <typename T>
NPR_HOST_DEVICE inline Vec3<T> logSO3(const Mat3<T>& R) {
  const T trace = R.m[0][0] + R.m[1][1] + R.m[2][2];
  T q[4];  // x, y, z, w, times a common factor
  int i = 0;
  if (R.m[1][1] > R.m[0][0]) i = 1;
  if (R.m[2][2] > R.m[i][i]) i = 2;
  if (trace > R.m[i][i]) {
    q[0] = R.m[2][1] - R.m[1][2];
    q[1] = R.m[0][2] - R.m[2][0];
    q[2] = R.m[1][0] - R.m[0][1];
    q[3] = 1 + trace;
  } else {
    const int j = (i + 1) % 3;
    const int k = (i + 2) % 3;
    q[i] = 1 + 2 * R.m[i][i] - trace;
    q[j] = R.m[j][i] + R.m[i][j];
    q[k] = R.m[k][i] + R.m[i][k];
    q[3] = R.m[k][j] - R.m[j][k];
  }
  const Vec3<T> axis = {q[0], q[1], q[2]};
  const T length = norm(axis);
  if (!(length > 0)) return {0, 0, 0};
  const T sign = q[3] < 0 ? T(-1) : T(1);
  return (sign * 2 * std::atan2(length, sign * q[3]) / length) * axis;
}

/// The rotation nearest to one that is off by rounding: one step of Newton's iteration for the
/// polar decomposition, R (3 I - R^T R) / 2, which leaves the square of the error.
template <typename T>
NPR_HOST_DEVICE inline Mat3<T> orthonormalized(const Mat3<T>& R) {
  Mat3<T> correction;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      correction.m[i][j] = ((i == j ? 3 : 0) - dot(column(R, i), column(R, j))) / 2;
    }
  }
  return R * correction;
}

}  // namespace nerf_pose_refiner
