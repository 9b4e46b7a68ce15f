// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
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

/// A point of the scene that structure from motion found.
struct ScenePoint {
  Eigen::Vector3d position_O = Eigen::Vector3d::Zero();  ///< [model units]
  std::array<std::uint8_t, 3> rgb = {};
  double error_px = 0;       ///< mean reprojection error; negative: unknown
  std::uint32_t photos = 0;  ///< that it was found in (the length of its track)
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
  double metres_per_unit = 0;      ///< 0: unknown
  std::vector<ScenePoint> points;  ///< of the scene, its surroundings included; may be empty
  std::vector<std::string> notes;  ///< sentences for the user: what was chosen or left out
};

/// How much a dataset may ask of the machine. What goes beyond is refused before an image is
/// decoded.
struct DatasetLimits {
  std::uint64_t json_bytes = std::uint64_t{1} << 24;   ///< of a JSON file
  std::uint64_t model_bytes = std::uint64_t{1} << 31;  ///< of a file of a COLMAP model
  std::uint64_t points = std::uint64_t{1} << 22;       ///< of the scene, which take 64 bytes each
  std::uint64_t frames = 5000;                         ///< photos with a pose
  std::uint64_t image_pixels = 64000000;               ///< of an image or a mask
  std::uint64_t pixels = 1000000000;        ///< of all images, which take 4 bytes a pixel
  std::uint64_t image_bytes = 16000000000;  ///< of the files of all images and masks
};

/// How a dataset is read.
struct DatasetOptions {
  int threads = 0;  ///< that read images; 0: all cores
  /// Refuses files that are not below the dataset's folder: absolute paths, "..", links that lead
  /// out. For datasets of users who may not read all files.
  bool confined = false;
  int object_id = 0;  ///< of a BOP dataset's objects; 0: the only one
  DatasetLimits limits;
};

/// Reads posed photos in any of the forms of docs/photo_formats.md, which is found out by looking
/// into the folder: transforms.json (this package, nerfstudio, instant-ngp, NeRF Synthetic),
/// COLMAP, BOP, Polycam, Record3D.
///
/// `path` is a folder, or a transforms.json. Camera axes become optical ones here and nowhere else,
/// and principal points, which most files count from the image's corner, lose 0.5. Photos of lenses
/// with distortion are undistorted. Opacity comes from an alpha channel, a mask, or both
/// multiplied. Without alpha, masks and a stated box the points of the scene give a box.
/// @param cancellation checked between images.
/// @throws std::runtime_error naming the file and the frame: for an image or mask that is missing,
/// damaged, of another size or not allowed, a pose that is not finite or not rigid, intrinsics
/// that are missing or make no sense, a lens that is not known, alpha in some frames only, one
/// image in two frames, more than `options.limits`, no frames, broken files, an unknown form, a BOP
/// object that is not there or not chosen. Cancelled.
Dataset loadDataset(const std::string& path, const DatasetOptions& options = {},
                    const CancellationToken& cancellation = {});

}  // namespace nerf_pose_refiner
