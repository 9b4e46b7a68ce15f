// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "math/host_device.h"

namespace nerf_pose_refiner {

/// Three numbers: a point, a direction, a colour.
template <typename T>
struct Vec3 {
  T x, y, z;
};

/// A 3 x 3 matrix, m[row][column].
template <typename T>
struct Mat3 {
  T m[3][3];
};

template <typename T>
NPR_HOST_DEVICE inline Vec3<T> operator+(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}

template <typename T>
NPR_HOST_DEVICE inline Vec3<T> operator-(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}

template <typename T>
NPR_HOST_DEVICE inline Vec3<T> operator-(const Vec3<T>& a) {
  return {-a.x, -a.y, -a.z};
}

template <typename T>
NPR_HOST_DEVICE inline Vec3<T> operator*(T s, const Vec3<T>& a) {
  return {s * a.x, s * a.y, s * a.z};
}

template <typename T>
NPR_HOST_DEVICE inline Vec3<T>& operator+=(Vec3<T>& a, const Vec3<T>& b) {
  return a = a + b;
}

template <typename T>
NPR_HOST_DEVICE inline T dot(const Vec3<T>& a, const Vec3<T>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}

template <typename T>
NPR_HOST_DEVICE inline Vec3<T> cross(const Vec3<T>& a, const Vec3<T>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

template <typename T>
NPR_HOST_DEVICE inline T norm(const Vec3<T>& a) {
  return std::sqrt(dot(a, a));
}

/// The unit vector along a; the caller makes sure that a is not zero.
template <typename T>
NPR_HOST_DEVICE inline Vec3<T> normalized(const Vec3<T>& a) {
  return (T(1) / norm(a)) * a;
}

/// Column c of A.
template <typename T>
NPR_HOST_DEVICE inline Vec3<T> column(const Mat3<T>& A, int c) {
  return {A.m[0][c], A.m[1][c], A.m[2][c]};
}

/// A x.
template <typename T>
NPR_HOST_DEVICE inline Vec3<T> operator*(const Mat3<T>& A, const Vec3<T>& x) {
  return {A.m[0][0] * x.x + A.m[0][1] * x.y + A.m[0][2] * x.z,
          A.m[1][0] * x.x + A.m[1][1] * x.y + A.m[1][2] * x.z,
          A.m[2][0] * x.x + A.m[2][1] * x.y + A.m[2][2] * x.z};
}

/// A^T x: the inverse rotation if A is a rotation.
template <typename T>
NPR_HOST_DEVICE inline Vec3<T> transposedTimes(const Mat3<T>& A, const Vec3<T>& x) {
  return {dot(column(A, 0), x), dot(column(A, 1), x), dot(column(A, 2), x)};
}

/// A B.
template <typename T>
NPR_HOST_DEVICE inline Mat3<T> operator*(const Mat3<T>& A, const Mat3<T>& B) {
  Mat3<T> product;
  for (int c = 0; c < 3; ++c) {
    const Vec3<T> v = A * column(B, c);
    product.m[0][c] = v.x;
    product.m[1][c] = v.y;
    product.m[2][c] = v.z;
  }
  return product;
}

/// A B^T.
template <typename T>
NPR_HOST_DEVICE inline Mat3<T> timesTransposed(const Mat3<T>& A, const Mat3<T>& B) {
  Mat3<T> product;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      product.m[i][j] = A.m[i][0] * B.m[j][0] + A.m[i][1] * B.m[j][1] + A.m[i][2] * B.m[j][2];
    }
  }
  return product;
}

}  // namespace nerf_pose_refiner
