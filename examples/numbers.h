// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/pose.h>

#include <Eigen/Geometry>
#include <cstdlib>
#include <stdexcept>
#include <string>

/// A number on the command line. @throws std::runtime_error if it is none.
inline double numberOf(const char* text) {
  char* end = nullptr;
  const double number = std::strtod(text, &end);
  if (end == text || *end) throw std::runtime_error("'" + std::string(text) + "' is not a number");
  return number;
}

/// A pose of seven numbers: x y z, and a quaternion x y z w. @throws std::runtime_error if its
/// length is zero.
inline nerf_pose_refiner::Pose poseOf(const double* number) {
  const Eigen::Quaterniond q(number[6], number[3], number[4], number[5]);
  if (!(q.norm() > 1e-6)) throw std::runtime_error("the quaternion has no length");
  nerf_pose_refiner::Pose pose;
  pose.t = {number[0], number[1], number[2]};
  pose.R = q.normalized().toRotationMatrix();
  return pose;
}
