// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/prediction.h"

#include <algorithm>

#include "nerf_pose_refiner/symmetry.h"

namespace nerf_pose_refiner {

Prior predictConstantVelocity(const Prior& last, const Pose& T_O_C_before, double time_ratio,
                              const FieldMetadata& object) {
  // The ratio is NaN if the stamps are so close that their difference is lost in rounding.
  const double ratio = time_ratio > 0 ? std::min(time_ratio, kMaxPredictionRatio) : 0;
  const Pose T_C_O_before =
      nearestEquivalent(T_O_C_before, last.T_O_C, object.symmetries).inverse();
  Pose T_C_O = last.T_O_C.inverse();
  const Eigen::Vector3d centre_C = T_C_O * object.centre;
  const Eigen::Vector3d shift_C = centre_C - T_C_O_before * object.centre;
  const Eigen::Vector3d turn_C = logSO3(Eigen::Matrix3d(T_C_O.R * T_C_O_before.R.transpose()));
  const auto limited = [ratio](double motion, double most) {
    return motion * ratio > most ? most / motion : ratio;
  };
  T_C_O.R = expSO3(limited(turn_C.norm(), last.rotation_rad) * turn_C) * T_C_O.R;
  const double shift_ratio = limited(shift_C.norm(), last.translation * object.diameter);
  T_C_O.t = centre_C + shift_ratio * shift_C - T_C_O.R * object.centre;
  Prior moved = last;
  moved.T_O_C = T_C_O.inverse();
  return moved;
}

}  // namespace nerf_pose_refiner
