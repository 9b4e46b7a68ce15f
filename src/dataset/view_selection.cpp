// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/view_selection.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "math/angle.h"
#include "math/require.h"

namespace nerf_pose_refiner {
namespace {

// Directions are 45 degrees apart at most: a view between two of them covers both.
const double kCoveringCosine = std::cos(35 * kDegree);

std::string axisName(int sign, char axis) {
  if (sign == 0) return "";
  return std::string(1, sign > 0 ? '+' : '-') + axis;
}

}  // namespace

Coverage::Coverage() {
  for (int x = -1; x <= 1; ++x) {
    for (int y = -1; y <= 1; ++y) {
      for (int z = -1; z <= 1; ++z) {
        if (x == 0 && y == 0 && z == 0) continue;
        directions_.push_back({Eigen::Vector3d(x, y, z).normalized(),
                               axisName(x, 'x') + axisName(y, 'y') + axisName(z, 'z')});
      }
    }
  }
}

void Coverage::add(const Eigen::Vector3d& direction_O) {
  const Eigen::Vector3d unit = direction_O.normalized();
  for (Direction& d : directions_) {
    d.covered = d.covered || d.direction.dot(unit) >= kCoveringCosine;
  }
}

bool Coverage::adds(const Eigen::Vector3d& direction_O) const {
  const Eigen::Vector3d unit = direction_O.normalized();
  return std::any_of(directions_.begin(), directions_.end(), [&](const Direction& d) {
    return !d.covered && d.direction.dot(unit) >= kCoveringCosine;
  });
}

double Coverage::fraction() const {
  const auto covered = std::count_if(directions_.begin(), directions_.end(),
                                     [](const Direction& d) { return d.covered; });
  return static_cast<double>(covered) / static_cast<double>(directions_.size());
}

std::vector<std::string> Coverage::missing() const {
  std::vector<std::string> names;
  for (const Direction& d : directions_) {
    if (!d.covered) names.push_back(d.name);
  }
  return names;
}

void ViewSelectionSettings::validate() const {
  require(min_angle_deg >= 0 && min_angle_deg <= 180, "ViewSelectionSettings::min_angle_deg",
          min_angle_deg, "0..180");
  require(min_distance >= 0, "ViewSelectionSettings::min_distance", min_distance, "0 or more");
  require(min_sharpness >= 0 && min_sharpness <= 1, "ViewSelectionSettings::min_sharpness",
          min_sharpness, "0..1");
  require(recent_images >= 1 && recent_images <= 1000, "ViewSelectionSettings::recent_images",
          recent_images, "1..1000");
}

ViewSelection::ViewSelection(const ViewSelectionSettings& settings,
                             const Eigen::Vector3d& object_centre)
    : settings_(settings), object_centre_(object_centre) {
  settings_.validate();
}

bool ViewSelection::isNew(const Pose& T_O_C) const {
  const Eigen::Vector3d direction = directionOf(T_O_C).normalized();
  const double cosine = std::cos(settings_.min_angle_deg * kDegree);
  return std::all_of(centres_.begin(), centres_.end(), [&](const Eigen::Vector3d& kept) {
    return (kept - object_centre_).normalized().dot(direction) <= cosine ||
           (kept - T_O_C.t).norm() >= settings_.min_distance;
  });
}

ViewDecision ViewSelection::judge(const Pose& T_O_C, double sharpness) {
  recent_.push_back(sharpness);
  if (static_cast<int>(recent_.size()) > settings_.recent_images) recent_.pop_front();
  std::vector<double> sorted(recent_.begin(), recent_.end());
  std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
  const double median = sorted[sorted.size() / 2];
  // The first image alone says nothing: it may be the blurred one.
  const bool enough = static_cast<int>(recent_.size()) == settings_.recent_images;
  if (settings_.min_sharpness > 0 && !(enough && sharpness >= settings_.min_sharpness * median)) {
    return ViewDecision::kBlurred;
  }
  return isNew(T_O_C) ? ViewDecision::kKeep : ViewDecision::kTooNear;
}

void ViewSelection::keep(const Pose& T_O_C) {
  centres_.push_back(T_O_C.t);
  coverage_.add(directionOf(T_O_C));
}

}  // namespace nerf_pose_refiner
