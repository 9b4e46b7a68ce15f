// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cmath>

namespace nerf_pose_refiner {

/// A number with its derivatives by the position (0..2) and by a turn of the direction (3..5).
struct Dual {
  double value = 0;
  Eigen::Matrix<double, 6, 1> d = Eigen::Matrix<double, 6, 1>::Zero();
};

inline Dual operator+(const Dual& a, const Dual& b) { return {a.value + b.value, a.d + b.d}; }
inline Dual operator-(const Dual& a, const Dual& b) { return {a.value - b.value, a.d - b.d}; }
inline Dual operator*(const Dual& a, const Dual& b) {
  return {a.value * b.value, a.value * b.d + b.value * a.d};
}
inline Dual operator*(double s, const Dual& a) { return {s * a.value, s * a.d}; }
inline Dual operator+(double s, const Dual& a) { return {s + a.value, a.d}; }
inline Dual relu(const Dual& a) { return a.value > 0 ? a : Dual(); }
inline Dual exponential(const Dual& a) {
  const double e = std::exp(a.value);
  return {e, e * a.d};
}
inline Dual sine(const Dual& a) { return {std::sin(a.value), std::cos(a.value) * a.d}; }
inline Dual sigmoid(const Dual& a) {
  const double s = 1 / (1 + std::exp(-a.value));
  return {s, s * (1 - s) * a.d};
}

}  // namespace nerf_pose_refiner
