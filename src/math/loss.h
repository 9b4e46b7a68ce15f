// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <stdexcept>
#include <string>

#include "math/host_device.h"

namespace nerf_pose_refiner {

/// Losses between a rendered and an observed colour value (Lin et al., section IV-C).
enum class Loss { kL1, kL2, kLogL1, kRelativeL2, kMape, kSmape, kSmoothL1 };

constexpr int kLossCount = 7;

/// Name of a loss in settings and tables: "l1", "l2", "log_l1", "relative_l2", "mape", "smape",
/// "smooth_l1".
inline const char* lossName(Loss loss) {
  constexpr const char* kNames[kLossCount] = {"l1",   "l2",    "log_l1",   "relative_l2",
                                              "mape", "smape", "smooth_l1"};
  return kNames[static_cast<int>(loss)];
}

/// The loss of that name. @throws std::invalid_argument listing the names that exist.
inline Loss lossFromName(const std::string& name) {
  std::string known;
  for (int i = 0; i < kLossCount; ++i) {
    const Loss loss = static_cast<Loss>(i);
    if (name == lossName(loss)) return loss;
    known += (i > 0 ? ", " : "") + std::string(lossName(loss));
  }
  throw std::invalid_argument("no loss is called '" + name + "'; there are " + known);
}

/// Value of a loss and its derivative with respect to the prediction.
template <typename T>
struct LossTerm {
  T value;
  T derivative;
};

/// A loss of one colour channel. Where a loss has a kink the derivative is 0.
///
/// The relative losses hold their denominator constant in the derivative: it weighs the error and
/// must not be something to make larger. 0.01 keeps it away from 0 in black pixels.
template <typename T>
NPR_HOST_DEVICE inline LossTerm<T> lossTerm(Loss loss, T prediction, T target) {
  constexpr T kFloor = T(0.01);
  constexpr T kBeta = T(0.1);  // where the smooth L1 loss turns from a parabola into a line
  const T error = prediction - target;
  const T magnitude = std::abs(error);
  const T sign = error > 0 ? T(1) : error < 0 ? T(-1) : T(0);
  switch (loss) {
    case Loss::kL1:
      return {magnitude, sign};
    case Loss::kL2:
      return {error * error, 2 * error};
    case Loss::kLogL1:
      return {std::log1p(magnitude), sign / (1 + magnitude)};
    case Loss::kRelativeL2: {
      const T weight = 1 / (prediction * prediction + kFloor);
      return {error * error * weight, 2 * error * weight};
    }
    case Loss::kMape: {
      const T weight = 1 / (std::abs(prediction) + kFloor);
      return {magnitude * weight, sign * weight};
    }
    case Loss::kSmape: {
      const T weight = 1 / ((std::abs(prediction) + std::abs(target)) / 2 + kFloor);
      return {magnitude * weight, sign * weight};
    }
    case Loss::kSmoothL1:
      if (magnitude < kBeta) return {error * error / (2 * kBeta), error / kBeta};
      return {magnitude - kBeta / 2, sign};
  }
  return {0, 0};
}

}  // namespace nerf_pose_refiner
