// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>

#include "math/vec.h"

namespace nerf_pose_refiner {

/// Constants of Adam (Kingma and Ba 2015).
template <typename T>
struct AdamConstants {
  T beta1 = T(0.9);
  T beta2 = T(0.99);
  T epsilon = T(1e-8);
};

/// Moving averages of one number's gradient and of its square; start at zero.
template <typename T>
struct AdamMoments {
  T first = 0;
  T second = 0;
};

/// Takes a gradient into the moments and gives m^ / (sqrt(v^) + epsilon), both corrected for their
/// start at zero: the step is minus the learning rate times this.
/// @param update counts from 1, the first update after the moments were zero.
template <typename T>
NPR_HOST_DEVICE inline T adamDirection(const AdamConstants<T>& c, T gradient, int update,
                                       AdamMoments<T>* moments) {
  moments->first = c.beta1 * moments->first + (1 - c.beta1) * gradient;
  moments->second = c.beta2 * moments->second + (1 - c.beta2) * gradient * gradient;
  const T first = moments->first / (1 - std::pow(c.beta1, T(update)));
  const T second = moments->second / (1 - std::pow(c.beta2, T(update)));
  return first / (std::sqrt(second) + c.epsilon);
}

/// The same for a vector of t(3) or so(3): the first moments form a vector, the second moments are
/// taken element by element.
template <typename T>
NPR_HOST_DEVICE inline Vec3<T> adamDirection(const AdamConstants<T>& c, const Vec3<T>& gradient,
                                             int update, Vec3<AdamMoments<T>>* moments) {
  return {adamDirection(c, gradient.x, update, &moments->x),
          adamDirection(c, gradient.y, update, &moments->y),
          adamDirection(c, gradient.z, update, &moments->z)};
}

}  // namespace nerf_pose_refiner
