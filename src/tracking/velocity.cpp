// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/velocity.h"

#include <utility>

namespace nerf_pose_refiner {

std::optional<Velocity> VelocityEstimator::add(std::int64_t stamp_ns, const Pose& T_W_U,
                                               const Matrix6& covariance) {
  const std::optional<Sample> before =
      std::exchange(last_, std::optional<Sample>({stamp_ns, T_W_U, covariance}));
  if (!before || stamp_ns <= before->stamp_ns) return std::nullopt;
  // Unsigned: stamps come from outside, and their difference may not fit.
  const double interval_s =
      1e-9 * static_cast<double>(static_cast<std::uint64_t>(stamp_ns) -
                                 static_cast<std::uint64_t>(before->stamp_ns));
  if (interval_s > kMaxInterval_s) return std::nullopt;
  Velocity velocity;
  velocity.linear = (T_W_U.t - before->T_W_U.t) / interval_s;
  velocity.angular = logSO3(Eigen::Matrix3d(T_W_U.R * before->T_W_U.R.transpose())) / interval_s;
  velocity.covariance = (covariance + before->covariance) / (interval_s * interval_s);
  return velocity;
}

}  // namespace nerf_pose_refiner
