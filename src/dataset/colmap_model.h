// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// A camera of a COLMAP model, its principal point counted from the image's corner [px].
struct ColmapCamera {
  double width = 0, height = 0;
  double fx = 0, fy = 0, cx = 0, cy = 0;
  Distortion distortion;
};

using ColmapCameras = std::map<std::uint32_t, ColmapCamera>;  ///< by COLMAP's id

/// A photo with a pose; C has optical axes, as everywhere in COLMAP.
struct ColmapImage {
  std::string name;  ///< path from the folder of the photos
  std::uint32_t camera = 0;
  Pose T_C_O;
};

/// How a camera model of COLMAP numbers its parameters: focal lengths, principal point, distortion.
struct ColmapLens {
  int id;  ///< in binary files
  const char* name;
  std::size_t focal_lengths;  ///< 1 or 2
  std::size_t coefficients;   ///< of the distortion, in OpenCV's order
  Distortion::Model distortion;

  std::size_t parameters() const { return focal_lengths + 2 + coefficients; }
};

/// @throws std::runtime_error with the reason alone for a model that OpenCV's distortion cannot
/// express, or that does not exist.
const ColmapLens& colmapLens(int id);
const ColmapLens& colmapLens(const std::string& name);

/// A camera from its parameters as COLMAP lists them.
/// @throws std::runtime_error with the reason alone for values that make no sense.
ColmapCamera colmapCamera(const ColmapLens& lens, double width, double height,
                          const std::vector<double>& parameters);

/// T_C_O of COLMAP's seven numbers: quaternion w x y z, translation x y z.
/// @throws std::runtime_error with the reason alone.
Pose colmapPose(const std::vector<double>& numbers);

/// @throws std::runtime_error with the reason alone for a point that is not finite.
void checkColmapPoint(const ScenePoint& point);

}  // namespace nerf_pose_refiner
