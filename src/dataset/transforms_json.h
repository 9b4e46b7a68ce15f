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

/// A frame of a transforms.json: what the frame says, completed by what the file says for all.
struct TransformsFrame {
  std::string where;      ///< file, index and name, for messages
  std::string file_path;  ///< as written
  std::string mask_path;  ///< as written; empty: none
  Pose T_O_C;             ///< optical axes

  /// As written: principal point counted from the image's corner.
  std::optional<double> width, height, fl_x, fl_y, cx, cy;  ///< [px]
  std::optional<double> camera_angle_x, camera_angle_y;     ///< fields of view [rad]
  Distortion distortion;
};

struct TransformsFile {
  std::vector<TransformsFrame> frames;
  bool has_box = false;
  Eigen::Vector3d box_min = Eigen::Vector3d::Zero();
  Eigen::Vector3d box_max = Eigen::Vector3d::Zero();
  double metres_per_unit = 0;  ///< 0: unknown
};

/// Reads and checks the JSON; opens no image.
/// @throws std::runtime_error naming the file and the frame.
TransformsFile readTransformsJson(const std::string& path, const DatasetLimits& limits = {});

}  // namespace nerf_pose_refiner
