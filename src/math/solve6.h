// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "math/host_device.h"

namespace nerf_pose_refiner {

/// Normal equations of six unknowns: J^T W J x = -J^T W r.
template <typename T>
struct NormalEquations6 {
  T information[21] =
      {};  ///< J^T W J, lower triangle row by row: entry (i, j <= i) at i (i + 1) / 2 + j
  T gradient[6] = {};  ///< J^T W r
};

/// L D L^T of a symmetric matrix whose diagonal was scaled to one.
template <typename T>
struct Factors6 {
  T lower[21];       ///< L without its unit diagonal, whose places hold 1 / D
  T scale[6];        ///< 1 / sqrt(diagonal): unknowns are scaled by it
  T smallest_pivot;  ///< of D; 0 if the matrix is singular, indefinite or not finite
};

/// Factorises J^T W J with its diagonal multiplied by 1 + damping (Levenberg-Marquardt).
///
/// Scaling to a unit diagonal makes pivots comparable, whatever units the unknowns are in: 1 means
/// that the unknowns are independent, 0 that one of them follows from the others.
template <typename T>
NPR_HOST_DEVICE inline Factors6<T> factorise6(const T information[21], T damping) {
  Factors6<T> f;
  // (No step waits for a decision, so that a GPU's thread takes several at once.)
  bool is_definite = true;
  for (int i = 0; i < 6; ++i) {
    const T diagonal = information[i * (i + 3) / 2];
    is_definite = is_definite && diagonal > 0 && std::isfinite(diagonal);
    f.scale[i] = 1 / std::sqrt(diagonal);
  }
  T smallest = 1 + damping;
  for (int i = 0; i < 6; ++i) {
    T* row = f.lower + i * (i + 1) / 2;
    T pivot = 1 + damping;
    for (int j = 0; j < i; ++j) {
      const T* other = f.lower + j * (j + 1) / 2;
      T sum = information[i * (i + 1) / 2 + j] * f.scale[i] * f.scale[j];
      for (int k = 0; k < j; ++k) sum -= row[k] * other[k];
      row[j] = sum;  // L(i, j) D(j)
    }
    for (int j = 0; j < i; ++j) {
      const T product = row[j];
      row[j] = product * f.lower[j * (j + 3) / 2];
      pivot -= row[j] * product;
    }
    is_definite = is_definite && pivot > 0;
    row[i] = 1 / pivot;
    smallest = pivot < smallest ? pivot : smallest;
  }
  f.smallest_pivot = is_definite ? smallest : 0;
  return f;
}

/// Solves (J^T W J + damping diag(J^T W J)) x = -J^T W r.
/// @param smallest_pivot below this the equations count as ill-conditioned (see factorise6).
/// @return false, with x untouched, if they are ill-conditioned or not finite.
template <typename T>
NPR_HOST_DEVICE inline bool solve6(const NormalEquations6<T>& equations, T damping,
                                   T smallest_pivot, T x[6]) {
  const Factors6<T> f = factorise6(equations.information, damping);
  if (!(f.smallest_pivot > 0) || f.smallest_pivot < smallest_pivot) return false;
  T y[6];
  bool is_finite = true;
  for (int i = 0; i < 6; ++i) {
    y[i] = -equations.gradient[i] * f.scale[i];
    for (int j = 0; j < i; ++j) y[i] -= f.lower[i * (i + 1) / 2 + j] * y[j];
    is_finite = is_finite && std::isfinite(y[i]);
  }
  if (!is_finite) return false;
  for (int i = 0; i < 6; ++i) y[i] *= f.lower[i * (i + 3) / 2];
  for (int i = 5; i >= 0; --i) {
    for (int j = i + 1; j < 6; ++j) y[i] -= f.lower[j * (j + 1) / 2 + i] * y[j];
  }
  for (int i = 0; i < 6; ++i) x[i] = y[i] * f.scale[i];
  return true;
}

}  // namespace nerf_pose_refiner
