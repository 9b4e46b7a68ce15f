// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

namespace nerf_pose_refiner {

constexpr double kPi = 3.14159265358979323846;
constexpr double kDegree = kPi / 180;  ///< [rad]
constexpr double kDegreesPerRad = 180 / kPi;

}  // namespace nerf_pose_refiner
