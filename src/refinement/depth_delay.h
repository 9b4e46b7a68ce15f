// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "geometry/matrix6.h"

namespace nerf_pose_refiner {

/// What an image that has depth says of the depth's time.
struct DelayEvidence {
  Vector6 motion;      ///< of the camera relative to the object, as a twist a second
  Vector6 away;        ///< from the pose that colours show to the one that depth shows alone
  Matrix6 covariance;  ///< of that: of both poses
};

/// Finds out whether depth is of another moment than its stamp says: it then lags behind the
/// motion that colours show, whatever its direction. Needs an object that moves.
class DepthDelay {
 public:
  void learn(const DelayEvidence& image);

  /// How late depth is [s], once that is certain and more than a few milliseconds; negative: early.
  std::optional<double> found_s() const;

 private:
  double weighted_ = 0, information_ = 0;  // sums of delay * information [1/s], information [1/s^2]
};

}  // namespace nerf_pose_refiner
