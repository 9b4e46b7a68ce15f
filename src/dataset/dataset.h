// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// A photo with its camera and pose, undistorted, in this package's conventions: optical camera
/// axes, integer pixel centres, straight alpha.
struct PosedView {
  std::string name;                    ///< the file's path, for messages
  std::shared_ptr<const Image8> rgba;  ///< [h][w][4], straight alpha; 255 where nothing is known
  Camera camera;
  Pose T_O_C;             ///< camera in the object's model frame, model units
  Camera photo_camera;    ///< of the file's image: `camera`, where there is no distortion
  Distortion distortion;  ///< that was taken out; a mask drawn on the photo needs the same
};

/// Posed photos of one object.
struct Dataset {
  std::string folder;
  std::vector<PosedView> views;
  bool has_alpha = false;  ///< alpha comes from the images or from masks
  bool has_masks = false;  ///< from masks: the images show what is around the object, too
  bool has_box = false;
  Eigen::Vector3d box_min = Eigen::Vector3d::Zero();  ///< of the object, model units
  Eigen::Vector3d box_max = Eigen::Vector3d::Zero();
  double metres_per_unit = 0;  ///< 0: unknown
};

/// How much a dataset may ask of the machine. What goes beyond is refused before an image is
/// decoded.
struct DatasetLimits {
  std::uint64_t json_bytes = std::uint64_t{1} << 24;    ///< of the transforms.json
  std::uint64_t frames = 5000;                          ///< that it lists
  std::uint64_t image_pixels = std::uint64_t{1} << 26;  ///< of an image or a mask
  std::uint64_t pixels = std::uint64_t{1} << 30;  ///< of all images, which take 4 bytes a pixel
};

/// How a dataset is read.
struct DatasetOptions {
  int threads = 0;  ///< that read images; 0: all cores
  /// Refuses images and masks that are not below the folder of the transforms.json: absolute
  /// paths, "..", links that lead out. For datasets of users who may not read all files.
  bool confined = false;
  DatasetLimits limits;
};

/// Reads a transforms.json as NeRF Synthetic and instant-ngp write it.
///
/// `path` is the JSON file, or a folder that holds transforms.json or transforms_train.json.
/// Camera-to-world matrices with OpenGL axes (x right, y up, z back) become optical ones here and
/// nowhere else; principal points, which the file counts from the image's corner, lose 0.5.
/// Distorted images (k1 k2 p1 p2 k3 to k6, OpenCV's) are undistorted.
///
/// Intrinsics (fl_x fl_y cx cy w h, or camera_angle_x and _y) are in the file, or in a frame for
/// that frame. Opacity comes from an alpha channel, a `mask_path` of the frame, or both multiplied.
/// The box is `object_aabb` or `aabb`, [[min], [max]] in the units of the poses, and
/// `metres_per_unit` their scale. Other keys are ignored.
/// @param cancellation checked between images.
/// @throws std::runtime_error naming the file and the frame: for an image or mask that is missing,
/// damaged, of another size or not allowed, a matrix that is not finite or not rigid, intrinsics
/// that are missing or make no sense, a camera that is no pinhole, alpha in some frames only, one
/// image in two frames, more than `options.limits`, no frames, broken JSON. Cancelled.
Dataset loadTransforms(const std::string& path, const DatasetOptions& options = {},
                       const CancellationToken& cancellation = {});

}  // namespace nerf_pose_refiner
