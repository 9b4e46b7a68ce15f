// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/calibration.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <stdexcept>

#include "geometry/matrix6.h"
#include "math/require.h"
#include "math/so3.h"
#include "refinement/covariance.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kRobust = 3;  // sightings that are farther off weigh less [standard deviations]
constexpr int kIterations = 20;
constexpr double kPosesAlike = 8;  // sightings share errors of the model: so many are worth one

/// From one pose to another: position and rotation, both along and about the fixed axes.
Vector6 difference(const Pose& from, const Pose& to) {
  Vector6 away;
  away << to.t - from.t, logSO3(Eigen::Matrix3d(to.R * from.R.transpose()));
  return away;
}

/// The object in the first camera by all cameras but one; nothing: no other one saw it.
std::optional<CameraSighting> byOthers(const RigSighting& sighting, const std::vector<Pose>& T_C_V,
                                       std::size_t but) {
  std::optional<CameraSighting> all;
  Matrix6 information = Matrix6::Zero();
  Vector6 sum = Vector6::Zero();
  for (std::size_t i = 0; i < std::min(sighting.size(), T_C_V.size()); ++i) {
    if (i == but || !sighting[i]) continue;
    const Pose T_C_O = T_C_V[i] * sighting[i]->T_V_O;
    if (!all) all = CameraSighting{T_C_O, Matrix6::Zero()};
    const Matrix6 of_one = inverseOf(rotated(sighting[i]->covariance, T_C_V[i].R));
    information += of_one;
    sum += of_one * difference(all->T_V_O, T_C_O);
  }
  if (!all) return all;
  const Vector6 step = solved(information, sum);
  all->T_V_O.t += step.head<3>();
  all->T_V_O.R = nearestRotation(expSO3(Eigen::Vector3d(step.tail<3>())) * all->T_V_O.R);
  all->covariance = inverseOf(information);
  return all;
}

/// A sighting by the camera in question and by the others.
struct Pair {
  CameraSighting own, others;
};

/// Normal equations of a small motion of the camera: its position, and a turn about it, along and
/// about the first camera's axes.
struct Equations {
  Matrix6 information = Matrix6::Zero();
  Vector6 gradient = Vector6::Zero();
  double squared = 0;
};

Equations equationsAt(const std::vector<Pair>& pairs, const Pose& T_C_V) {
  Equations sum;
  for (const Pair& pair : pairs) {
    const Pose T_C_O = T_C_V * pair.own.T_V_O;
    const Vector6 residual = difference(T_C_O, pair.others.T_V_O);
    const Matrix6 covariance = rotated(pair.own.covariance, T_C_V.R) + pair.others.covariance;
    Matrix6 jacobian = Matrix6::Identity();  // of the object's pose by the motion
    jacobian.topRightCorner<3, 3>() = -crossOf(T_C_O.t - T_C_V.t);
    const double away = std::sqrt(squaredDistance(residual, covariance) / 6);
    const double weight = away > kRobust ? kRobust / away : 1;
    sum.information += weight * jacobian.transpose() * solved(covariance, jacobian);
    sum.gradient += weight * jacobian.transpose() * solved(covariance, residual);
    sum.squared += std::pow(std::min(away, kRobust), 2);
  }
  return sum;
}

/// A direction of motion in words, by its larger parts.
std::string inWords(const Vector6& direction) {
  constexpr const char* kNames[] = {"along x", "along y", "along z",
                                    "about x", "about y", "about z"};
  constexpr double kWorthNaming = 0.35;
  std::string words;
  for (int i = 0; i < 6; ++i) {
    if (std::abs(direction[i]) < kWorthNaming) continue;
    words += (words.empty() ? "" : " with ") + std::string(kNames[i]);
  }
  return words;
}

/// The directions that sightings fix, in units of the goals.
struct Seen {
  Matrix6 projection = Matrix6::Zero();  // of a motion, in units of the goals
  Matrix6 covariance = Matrix6::Zero();
  std::vector<std::string> unseen;
};

/// @param information in units of the goals.
Seen directionsOf(const Matrix6& information) {
  constexpr double kUnknown = 1e4;  // deviation of what is not seen at all [goals]
  Seen seen;
  const Eigen6 eigen = eigenOf(information);
  for (int i = 0; i < 6; ++i) {
    const Vector6 direction = eigen.vectors.col(i);
    const double known = std::max(eigen.values[i], 1 / (kUnknown * kUnknown));
    seen.covariance += direction * direction.transpose() / known;
    if (known >= 1) {
      seen.projection += direction * direction.transpose();
    } else {
      seen.unseen.push_back(inWords(direction));
    }
  }
  return seen;
}

std::vector<Pair> pairsOf(const std::vector<RigSighting>& sightings, const std::vector<Pose>& T_C_V,
                          std::size_t camera) {
  std::vector<Pair> pairs;
  for (const RigSighting& sighting : sightings) {
    if (camera >= sighting.size() || !sighting[camera]) continue;
    if (const auto others = byOthers(sighting, T_C_V, camera)) {
      pairs.push_back({*sighting[camera], *others});
    }
  }
  return pairs;
}

/// Moves a camera where pairs show it. @param along motions in units of the goals that it may make.
/// @return the equations there.
Equations moveTo(const std::vector<Pair>& pairs, const Vector6& goals, const Matrix6& along,
                 Pose* T_C_V) {
  constexpr double kWeak = 1e-8;  // of a goal squared: keeps what is not seen in its place
  const Matrix6 unit = goals.asDiagonal();
  for (int i = 0; i < kIterations; ++i) {
    const Equations at = equationsAt(pairs, *T_C_V);
    const Matrix6 information = along * unit * at.information * unit * along +
                                (Matrix6::Identity() - along) + kWeak * Matrix6::Identity();
    const Vector6 step = unit * (along * solved(information, Vector6(along * unit * at.gradient)));
    T_C_V->t += step.head<3>();
    T_C_V->R = nearestRotation(expSO3(Eigen::Vector3d(step.tail<3>())) * T_C_V->R);
    if (step.cwiseQuotient(goals).norm() < 1e-6) break;
  }
  return equationsAt(pairs, *T_C_V);
}

/// Refines the place of a camera; in directions that are not seen, it stays as it was stated.
Seen refineBy(const std::vector<Pair>& pairs, const CalibrationSettings& settings,
              CameraCalibration* result) {
  Vector6 goals;
  goals << Eigen::Vector3d::Constant(settings.position_goal_m),
      Eigen::Vector3d::Constant(settings.rotation_goal_rad);
  const Matrix6 unit = goals.asDiagonal();
  const Pose stated = result->T_C_V;
  Seen seen;
  seen.projection.setIdentity();
  constexpr int kPasses = 2;  // where all goes, then where what is seen goes
  for (int pass = 0; pass < kPasses; ++pass) {
    result->T_C_V = stated;
    const Equations at = moveTo(pairs, goals, seen.projection, &result->T_C_V);
    result->misfit = std::sqrt(at.squared / static_cast<double>(pairs.size()));
    const double scale = std::max(1.0, result->misfit * result->misfit);  // errors are as they show
    if (pass == 0) seen = directionsOf(unit * at.information * unit / scale);
    if (seen.unseen.empty()) break;
  }
  result->covariance = kPosesAlike * unit * seen.covariance * unit;
  return seen;
}

}  // namespace

CameraCalibration calibrateCamera(const std::vector<RigSighting>& sightings,
                                  const std::vector<Pose>& T_C_V, std::size_t camera,
                                  const CalibrationSettings& settings) {
  if (camera == 0 || camera >= T_C_V.size()) {
    throw std::invalid_argument("calibrateCamera: there is no further camera of this number");
  }
  require(settings.min_sightings >= 1, "CalibrationSettings::min_sightings", settings.min_sightings,
          "1 or more");
  require(settings.position_goal_m > 0 && settings.rotation_goal_rad > 0,
          "CalibrationSettings::position_goal_m", settings.position_goal_m, "> 0, as the rotation");
  CameraCalibration result;
  result.T_C_V = T_C_V[camera];
  const std::vector<Pair> pairs = pairsOf(sightings, T_C_V, camera);
  result.sightings = static_cast<int>(pairs.size());
  if (result.sightings < settings.min_sightings) {
    result.message = "the camera saw the object with another one in " +
                     std::to_string(result.sightings) + " poses; " +
                     std::to_string(settings.min_sightings) + " are needed";
    return result;
  }
  const Seen seen = refineBy(pairs, settings, &result);
  result.unseen = seen.unseen;
  result.success = seen.unseen.size() < 6;
  if (!seen.unseen.empty()) {
    result.message = "the poses do not fix";
    for (const std::string& direction : seen.unseen) result.message += " (" + direction + ")";
    result.message += ": spread them more, nearer and farther, and turned";
  }
  return result;
}

}  // namespace nerf_pose_refiner
