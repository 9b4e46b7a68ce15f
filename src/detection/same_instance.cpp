// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/same_instance.h"

#include <algorithm>
#include <cmath>

namespace nerf_pose_refiner {

SameInstance::SameInstance(const Field& field) : centre_(field.metadata.centre) {
  constexpr double kOfDiameter = 0.35, kOfSide = 0.75, kLeast = 0.15;  // the last of the diameter
  const double diameter = field.metadata.diameter;
  const Box& box = field.metadata.box ? *field.metadata.box : field.box;
  across_ = std::clamp(kOfSide * (box.max - box.min).minCoeff(), kLeast * diameter,
                       kOfDiameter * diameter);
}

bool SameInstance::operator()(const Pose& a_T_O_C, const Pose& b_T_O_C) const {
  constexpr double kAlong = 0.2;  // logarithm of the distances' ratio
  const Eigen::Vector3d a = a_T_O_C.inverse() * centre_, b = b_T_O_C.inverse() * centre_;
  const Eigen::Vector3d scaled = b * (a.norm() / b.norm());
  return (scaled - a).norm() < across_ && std::abs(std::log(a.norm() / b.norm())) < kAlong;
}

}  // namespace nerf_pose_refiner
