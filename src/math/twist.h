// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/projection.h"
#include "math/so3.h"

namespace nerf_pose_refiner {

/// A vector of se(3), or of its dual: (v, w), translation first.
template <typename T>
struct Twist {
  Vec3<T> v, w;
};

template <typename T>
NPR_HOST_DEVICE inline Twist<T> operator+(const Twist<T>& a, const Twist<T>& b) {
  return {a.v + b.v, a.w + b.w};
}

template <typename T>
NPR_HOST_DEVICE inline Twist<T> operator*(T s, const Twist<T>& a) {
  return {s * a.v, s * a.w};
}

/// The power series below end here: |w| <= 4 rad leaves less than 1e-14 of the first term.
constexpr int kTwistTerms = 28;

/// exp(xi) T, xi a vector of se(3) in the axes of O: p_O -> Exp(w) p_O + V v with
/// V = sum_n [w]_x^n / (n + 1)!.
template <typename T>
NPR_HOST_DEVICE inline CameraPose<T> expTimes(const Twist<T>& xi, const CameraPose<T>& pose) {
  const Mat3<T> turn = expSO3(xi.w);
  Vec3<T> term = xi.v, moved = xi.v;
  for (int n = 1; n < kTwistTerms; ++n) {
    term = (1 / T(n + 1)) * cross(xi.w, term);
    moved += term;
  }
  return {turn * pose.R, turn * pose.o + moved};
}

/// ad(xi)^T g, where ad(xi) (a, b) = (w x a + v x b, w x b) is the bracket of se(3).
template <typename T>
NPR_HOST_DEVICE inline Twist<T> adjointTransposed(const Twist<T>& xi, const Twist<T>& g) {
  return {cross(g.v, xi.w), cross(g.v, xi.v) + cross(g.w, xi.w)};
}

/// Gradient by xi of a function of exp(xi) T, from its gradient by the delta of exp(delta) exp(xi)
/// T: J_l(xi)^T g with the left Jacobian J_l = sum_n ad(xi)^n / (n + 1)! (Chirikjian, Stochastic
/// Models, Information Theory, and Lie Groups, volume 2, section 10.6).
template <typename T>
NPR_HOST_DEVICE inline Twist<T> gradientByTwist(const Twist<T>& xi, const Twist<T>& g) {
  Twist<T> term = g, sum = g;
  for (int n = 1; n < kTwistTerms; ++n) {
    term = (1 / T(n + 1)) * adjointTransposed(xi, term);
    sum = sum + term;
  }
  return sum;
}

}  // namespace nerf_pose_refiner
