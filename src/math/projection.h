// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/so3.h"
#include "math/vec.h"

namespace nerf_pose_refiner {

/// Pinhole intrinsics [px]; pixel centres are integers.
template <typename T>
struct Pinhole {
  T fx, fy, cx, cy;
};

/// A place in an image [px].
template <typename T>
struct Pixel {
  T u, v;
};

/// Pixel of a point in the camera's optical frame C. The caller makes sure that q_C.z > 0.
template <typename T>
NPR_HOST_DEVICE inline Pixel<T> project(const Pinhole<T>& K, const Vec3<T>& q_C) {
  return {K.fx * q_C.x / q_C.z + K.cx, K.fy * q_C.y / q_C.z + K.cy};
}

/// Derivative of a projection with respect to the point: a row for u and one for v [px / unit].
template <typename T>
struct ProjectionJacobian {
  Vec3<T> du, dv;
};

template <typename T>
NPR_HOST_DEVICE inline ProjectionJacobian<T> projectionJacobian(const Pinhole<T>& K,
                                                                const Vec3<T>& q_C) {
  const T inverse_depth = 1 / q_C.z;
  const T u = K.fx * inverse_depth;
  const T v = K.fy * inverse_depth;
  return {{u, 0, -u * q_C.x * inverse_depth}, {0, v, -v * q_C.y * inverse_depth}};
}

/// Camera in the object's frame O: rotation and position of T_O_C.
template <typename T>
struct CameraPose {
  Mat3<T> R;  ///< C to O
  Vec3<T> o;  ///< the camera's centre in O [model units]
};

/// Moves a camera by (v, w) about a point c of O: R <- Exp(w) R, o <- c + v + Exp(w) (o - c).
///
/// v [model units] and w [rad] are in the axes of O; the rotation is applied from the left.
template <typename T>
NPR_HOST_DEVICE inline CameraPose<T> moveCamera(const CameraPose<T>& pose, const Vec3<T>& c_O,
                                                const Vec3<T>& v, const Vec3<T>& w) {
  const Mat3<T> turn = expSO3(w);
  return {turn * pose.R, c_O + v + turn * (pose.o - c_O)};
}

/// How an image flows past a pixel when the camera moves by (v, w) as in moveCamera.
///
/// A scene point p (relative to c) that the pixel shows lies at q = R^T (p + c - o) in the camera.
/// Moving the camera moves it by dq = -R^T (v + w x p), hence its image by du/dq dq; at a fixed
/// pixel the image C changes by the opposite:
///
///     dC = grad C . du/dq . R^T (v + w x p)
///
/// which is direct alignment's Jacobian. `u` and `v` hold the factors of dC/du and dC/dv, in the
/// order (v, w).
template <typename T>
struct PixelFlow {
  T u[6];
  T v[6];
};

/// @param p point that the pixel shows, relative to c, in the axes of O; in front of the camera.
template <typename T>
NPR_HOST_DEVICE inline PixelFlow<T> pixelFlow(const Pinhole<T>& K, const CameraPose<T>& pose,
                                              const Vec3<T>& c_O, const Vec3<T>& p) {
  const Vec3<T> q_C = transposedTimes(pose.R, p + c_O - pose.o);
  const ProjectionJacobian<T> J = projectionJacobian(K, q_C);
  const Vec3<T> u = pose.R * J.du;
  const Vec3<T> v = pose.R * J.dv;
  const Vec3<T> u_turn = cross(p, u);  // u . (w x p) = w . (p x u)
  const Vec3<T> v_turn = cross(p, v);
  return {{u.x, u.y, u.z, u_turn.x, u_turn.y, u_turn.z},
          {v.x, v.y, v.z, v_turn.x, v_turn.y, v_turn.z}};
}

}  // namespace nerf_pose_refiner
