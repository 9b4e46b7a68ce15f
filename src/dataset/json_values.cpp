// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/json_values.h"

#include <Eigen/Geometry>
#include <cmath>
#include <cstring>
#include <stdexcept>

#include "files/json.h"

namespace nerf_pose_refiner {
namespace {

using Json = nlohmann::json;

constexpr double kRotationTolerance = 1e-3;

std::string withNullForNan(const std::string& text) {
  std::string result;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    if (text[i] == '"') in_string = !in_string;
    if (in_string) {
      if (text[i] == '\\' && i + 1 < text.size()) result += text[i++];
      result += text[i];
      continue;
    }
    std::size_t skipped = 0;
    for (const char* word : {"NaN", "-Infinity", "Infinity"}) {
      if (skipped == 0 && text.compare(i, std::strlen(word), word) == 0) {
        skipped = std::strlen(word);
      }
    }
    if (skipped == 0) {
      result += text[i];
    } else {
      result += "null";
      i += skipped - 1;
    }
  }
  return result;
}

const Json& required(const Json& object, const char* key, const std::string& where) {
  if (!object.is_object()) failAt(where, "not an object");
  const auto entry = object.find(key);
  if (entry == object.end()) failAt(where, std::string(key) + " is missing");
  return *entry;
}

}  // namespace

void failAt(const std::string& where, const std::string& what) {
  throw std::runtime_error(where + ": " + what);
}

Json parseDatasetJson(const std::string& text, const std::string& where) {
  try {
    return parseJson(withNullForNan(text));
  } catch (const std::exception& error) {
    failAt(where, error.what());
  }
}

std::string shortText(const Json& value) {
  return value.is_string() ? value.dump().substr(0, 100) : std::string(value.type_name());
}

double finiteNumber(const Json& value, const std::string& name, const std::string& where) {
  const double number = value.is_number() ? value.get<double>() : std::nan("");
  if (!std::isfinite(number)) failAt(where, name + " is not a finite number");
  return number;
}

double requiredNumber(const Json& object, const char* key, const std::string& where) {
  return finiteNumber(required(object, key, where), key, where);
}

double requiredPositive(const Json& object, const char* key, const std::string& where) {
  const double number = requiredNumber(object, key, where);
  if (number <= 0) failAt(where, std::string(key) + " is not positive");
  return number;
}

std::vector<double> requiredNumbers(const Json& object, const char* key, std::size_t count,
                                    const std::string& where) {
  const Json& list = required(object, key, where);
  if (!list.is_array() || list.size() != count) {
    failAt(where, std::string(key) + " is not a list of " + std::to_string(count) + " numbers");
  }
  std::vector<double> numbers;
  for (const Json& value : list) numbers.push_back(finiteNumber(value, key, where));
  return numbers;
}

Pose withOpticalAxes(const Pose& T_O_G) {
  return {T_O_G.R * Eigen::Vector3d(1, -1, -1).asDiagonal(), T_O_G.t};
}

Pose zUp() {
  Eigen::Matrix3d R;
  R << 0, 0, 1, 1, 0, 0, 0, 1, 0;
  return {R, Eigen::Vector3d::Zero()};
}

Eigen::Matrix3d rotationOf(const Eigen::Matrix3d& R, const std::string& name,
                           const std::string& where) {
  if (!Pose(R, Eigen::Vector3d::Zero()).isRigid(kRotationTolerance)) {
    failAt(where, name + " is not rigid");
  }
  return nearestRotation(R);
}

Eigen::Matrix3d rotationOf(const Eigen::Vector4d& wxyz, const std::string& where) {
  const Eigen::Quaterniond q(wxyz[0], wxyz[1], wxyz[2], wxyz[3]);
  const double norm = q.norm();
  if (!(std::isfinite(norm) && norm > 1e-6)) failAt(where, "the quaternion is not a rotation");
  return q.normalized().toRotationMatrix();
}

}  // namespace nerf_pose_refiner
