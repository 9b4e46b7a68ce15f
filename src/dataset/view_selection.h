// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <deque>
#include <string>
#include <vector>

#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// From where an object was photographed: of 26 directions around it, spread evenly over the faces,
/// edges and corners of a cube along the axes of O, which ones have a view within 35 degrees.
class Coverage {
 public:
  Coverage();

  /// @param direction_O from the object to the camera, of any length but zero.
  void add(const Eigen::Vector3d& direction_O);
  /// Whether a view from there would cover a direction that none covers yet.
  bool adds(const Eigen::Vector3d& direction_O) const;

  double fraction() const;  ///< of the directions that are covered, 0..1

  /// The others, as the object's axes have them: "-x", "+y-z", "-x-y+z".
  std::vector<std::string> missing() const;

 private:
  struct Direction {
    Eigen::Vector3d direction;  // unit length
    std::string name;
    bool covered = false;
  };
  std::vector<Direction> directions_;
};

/// When a moving camera's image is worth keeping.
struct ViewSelectionSettings {
  double min_angle_deg = 8;    ///< between directions to the camera, seen from the object, or ...
  double min_distance = 0.1;   ///< ... between cameras [model units], to each view that is kept
  double min_sharpness = 0.7;  ///< of the median of the recent images', 0: any
  int recent_images = 15;      ///< that sharpness is compared with, and are waited for at first

  /// @throws std::invalid_argument naming what is out of range.
  void validate() const;
};

enum class ViewDecision { kKeep, kTooNear, kBlurred };

/// Chooses views for a dataset as the images come: far enough from all that are kept, and sharp.
/// Not thread-safe.
class ViewSelection {
 public:
  /// @param object_centre in O [model units].
  ViewSelection(const ViewSelectionSettings& settings, const Eigen::Vector3d& object_centre);

  /// Judges the next image. @param sharpness @see sharpness(). Only the caller knows whether the
  /// image is kept in the end: @see keep.
  ViewDecision judge(const Pose& T_O_C, double sharpness);
  void keep(const Pose& T_O_C);

  Eigen::Vector3d directionOf(const Pose& T_O_C) const { return T_O_C.t - object_centre_; }
  int kept() const { return static_cast<int>(centres_.size()); }
  const Coverage& coverage() const { return coverage_; }

 private:
  bool isNew(const Pose& T_O_C) const;

  ViewSelectionSettings settings_;
  Eigen::Vector3d object_centre_;
  std::vector<Eigen::Vector3d> centres_;  ///< of the cameras that are kept
  std::deque<double> recent_;             ///< sharpness
  Coverage coverage_;
};

}  // namespace nerf_pose_refiner
