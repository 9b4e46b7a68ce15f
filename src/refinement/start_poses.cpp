// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/start_poses.h"

#include <cstdint>

#include "math/random.h"
#include "refinement/covariance.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::uint64_t kSeed = 1;

}  // namespace

std::vector<Pose> posesAround(const Prior& prior, const FieldMetadata& object, double spread,
                              int count, int round) {
  std::vector<Pose> poses = {prior.T_O_C};
  for (int i = 1; i < count; ++i) {
    const auto number = static_cast<std::uint64_t>(i) + static_cast<std::uint64_t>(round) * count;
    Eigen::Vector3d turn, shift;
    for (int a = 0; a < 3; ++a) {
      const auto drawn = [number](std::uint64_t axis) {
        return 2.0 * randomUniform(kSeed, axis, number) - 1;
      };
      turn[a] = spread * prior.rotation_rad * drawn(a);
      shift[a] = spread * prior.translation * object.diameter * drawn(3 + a);
    }
    const Eigen::Matrix3d R = expSO3(turn);
    poses.emplace_back(nearestRotation(R * prior.T_O_C.R),
                       object.centre + shift + R * (prior.T_O_C.t - object.centre));
  }
  return poses;
}

bool areNearlyTheSame(const Pose& a_T_O_C, const Pose& b_T_O_C, const FieldMetadata& object) {
  constexpr double kSameRotation = 0.03, kSameOffset = 0.03;  // [rad], [diameters]
  constexpr double kRounding = 1e-5;
  // The trace, 1 + 2 cos(angle), tells most pairs apart, for far less than their twist takes.
  constexpr double kLeastTrace = 3 - kSameRotation * kSameRotation - kRounding;
  if (a_T_O_C.R.cwiseProduct(b_T_O_C.R).sum() < kLeastTrace) return false;
  const Vector6 away = cameraTwist(a_T_O_C, b_T_O_C, object.centre);
  return away.tail<3>().norm() < kSameRotation &&
         away.head<3>().norm() < kSameOffset * object.diameter;
}

}  // namespace nerf_pose_refiner
