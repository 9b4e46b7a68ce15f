// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

// Values of datasets' files, which anybody may have written. Errors are std::runtime_error:
// `where`, the name of the value and what is wrong with it.

[[noreturn]] void failAt(const std::string& where, const std::string& what);

/// Parses the text of a dataset's file. NaN and Infinity, which Python writes and JSON does not
/// know, become null, so that the message can name the value and not just a line.
nlohmann::json parseDatasetJson(const std::string& text, const std::string& where);

/// A value as messages quote it.
std::string shortText(const nlohmann::json& value);

double finiteNumber(const nlohmann::json& value, const std::string& name, const std::string& where);

/// The number of that name in an object.
double requiredNumber(const nlohmann::json& object, const char* key, const std::string& where);
double requiredPositive(const nlohmann::json& object, const char* key, const std::string& where);

/// A list of exactly `count` numbers of that name in an object.
std::vector<double> requiredNumbers(const nlohmann::json& object, const char* key,
                                    std::size_t count, const std::string& where);

/// T_O_C of a camera pose with OpenGL's axes (x right, y up, z back), as most formats have them.
Pose withOpticalAxes(const Pose& T_O_G);

/// From a world with y up, ARKit's say, to one with z up: x, y, z become y, z, x.
Pose zUp();

/// The rotation nearest to one that a file holds with few digits.
/// @param name what it is called in messages. @param R must be a rotation to 1e-3.
Eigen::Matrix3d rotationOf(const Eigen::Matrix3d& R, const std::string& name,
                           const std::string& where);

/// The rotation of a quaternion of any length but zero.
Eigen::Matrix3d rotationOf(const Eigen::Vector4d& wxyz, const std::string& where);

}  // namespace nerf_pose_refiner
