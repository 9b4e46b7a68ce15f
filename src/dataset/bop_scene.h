// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// An object in an image of a BOP scene.
struct BopView {
  int image = 0;                          ///< number, which names the file
  int instance = 0;                       ///< place in the image's list, which names the mask
  int object = 0;                         ///< obj_id
  Pose T_C_O;                             ///< of the object's model [m]
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< [px], integer pixel centres, as OpenCV's
  double visible = 1;  ///< fraction of the silhouette that nothing hides; 1 if it is not stated
};

/// The content of the JSON files of a BOP scene, after the page "Format of BOP datasets" of
/// bop_toolkit.
struct BopSceneFiles {
  std::string name;        ///< of the scene, for messages
  std::string camera, gt;  ///< scene_camera.json, scene_gt.json
  std::string gt_info;     ///< scene_gt_info.json; empty: there is none
};

/// All objects in all images, sorted by the number of the image. Millimetres become metres.
/// @throws std::runtime_error naming the scene, the image and what is wrong.
std::vector<BopView> readBopScene(const BopSceneFiles& files);

}  // namespace nerf_pose_refiner
