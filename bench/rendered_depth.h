// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// Triangles of an object [m].
struct TriangleMesh {
  std::vector<Eigen::Vector3d> points;
  std::vector<std::array<int, 3>> triangles;
};

/// Reads vertices and faces of a Wavefront file. @throws std::runtime_error naming the file.
TriangleMesh readMesh(const std::string& path);

/// What stands before and behind the object.
struct DepthSurroundings {
  double wall_m = 1.4;  ///< behind everything; it waves by a tenth
  double card_m = 0;    ///< of a card before the object; 0: there is none
  PixelWindow card;     ///< what it covers, in the depth image
};

/// A stereo camera. Its errors are made in the disparity, before windows of several pixels.
struct StereoSensor {
  double baseline_m = 0.05;
  double noise_m = 0.002;     ///< deviation of a pixel at 0.6 m
  double holes = 0.2;         ///< fraction, in patches, beside the shadows of edges
  double step_px = 1.0 / 16;  ///< of disparity
  double bias_px = 0;         ///< of disparity
};

/// True depth of a mesh in its surroundings [m].
ImageOf<float> trueDepth(const TriangleMesh& mesh, const Pose& T_D_O, const Camera& camera,
                         const DepthSurroundings& around);

/// What a stereo camera makes of it; 0 where it sees nothing.
ImageOf<float> stereoDepth(const ImageOf<float>& truth, const Camera& camera,
                           const StereoSensor& sensor, std::mt19937_64* random);

}  // namespace nerf_pose_refiner
