// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/depth_delay.h"

#include <cmath>

namespace nerf_pose_refiner {

// The object is seen `delay` ago: away = -delay * motion, by weighted least squares.
void DepthDelay::learn(const DelayEvidence& image) {
  constexpr double kKept = 0.98;  // of what images before said
  const Vector6 pull = inverseOf(image.covariance) * image.motion;
  const double information = image.motion.dot(pull);
  // A pose that creeps towards what depth says of it does not move.
  constexpr double kLongest_s = 0.05;  // deviation of the delay that one image shows
  if (!(information * kLongest_s * kLongest_s > 1)) return;
  weighted_ = kKept * weighted_ - pull.dot(image.away);
  information_ = kKept * information_ + information;
}

std::optional<double> DepthDelay::found_s() const {
  // Errors of images that follow each other are alike: so many are worth one.
  constexpr double kImagesAlike = 5, kLeast_s = 0.012, kDeviations = 3;
  if (!(information_ > 0)) return std::nullopt;
  const double delay_s = weighted_ / information_;
  const double deviation_s = std::sqrt(kImagesAlike / information_);
  if (std::abs(delay_s) < kLeast_s + kDeviations * deviation_s) return std::nullopt;
  return delay_s;
}

}  // namespace nerf_pose_refiner
