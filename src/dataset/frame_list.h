// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// A photo that a dataset lists, with its camera and pose. The photo itself is not read yet.
struct FrameEntry {
  std::string where;  ///< file, place in it and name, for messages
  std::string image;  ///< path from the dataset's folder; its extension may be missing
  std::string mask;   ///< the same, complete; empty: none
  Pose T_O_C;         ///< optical axes

  /// The principal point is counted from the image's corner. Without sizes the camera is of the
  /// image as it is; without focal lengths there is a field of view.
  std::optional<double> width, height, fl_x, fl_y, cx, cy;  ///< [px]
  std::optional<double> camera_angle_x, camera_angle_y;     ///< fields of view [rad]
  Distortion distortion;
};

/// What the files of a dataset say, its images aside: what each format's reader gives.
struct FrameList {
  std::string folder;  ///< that paths start from
  std::vector<FrameEntry> frames;
  bool has_box = false;
  Eigen::Vector3d box_min = Eigen::Vector3d::Zero();
  Eigen::Vector3d box_max = Eigen::Vector3d::Zero();
  double metres_per_unit = 0;  ///< 0: unknown
  std::vector<ScenePoint> points;
  std::vector<std::string> notes;  ///< @see Dataset::notes
};

}  // namespace nerf_pose_refiner
