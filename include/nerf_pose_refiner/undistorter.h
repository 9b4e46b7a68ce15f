// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// Removes the lens distortion from the images of one camera.
///
/// The undistorted camera has the widest view in which every pixel comes from the distorted image;
/// its focal lengths and principal point therefore differ. Construct one per camera: the maps cost
/// more than an image. Without distortion, images pass through unchanged. Const methods are
/// thread-safe.
class Undistorter {
 public:
  /// @param camera intrinsics and size of the distorted images.
  /// @throws std::invalid_argument for a wrong number of coefficients, or for coefficients that are
  /// not finite or fold the image over itself.
  Undistorter(const Camera& camera, const Distortion& distortion);
  ~Undistorter();
  Undistorter(Undistorter&&) noexcept;
  Undistorter& operator=(Undistorter&&) noexcept;

  /// The camera of the undistorted images, which have the same size.
  const Camera& camera() const { return undistorted_; }

  /// @param image 1, 3 or 4 channels; the fourth is straight alpha.
  /// @throws std::invalid_argument if it does not have the camera's size.
  Image8 undistort(const Image8& image) const;

 private:
  struct Maps;
  Camera undistorted_;
  std::unique_ptr<Maps> maps_;  // null without distortion
};

}  // namespace nerf_pose_refiner
