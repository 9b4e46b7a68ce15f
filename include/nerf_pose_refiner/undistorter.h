// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// Takes the lens distortion out of the images of one camera.
///
/// The undistorted camera is the widest one whose image is filled wholly by the distorted one, so
/// no pixel is invented; its focal lengths and principal point therefore differ. Of a fisheye lens
/// it shows 70 degrees off the optical axis at most: what is farther out would be stretched over
/// many pixels. Built once per camera: the maps cost more than an image. Without distortion images
/// pass through unchanged.
/// Const methods may be called from many threads at once.
class Undistorter {
 public:
  /// @param camera intrinsics and size of the distorted images.
  /// @throws std::invalid_argument for another number of coefficients, or ones that are not finite
  /// or fold the image over itself.
  Undistorter(const Camera& camera, const Distortion& distortion);
  ~Undistorter();
  Undistorter(Undistorter&&) noexcept;
  Undistorter& operator=(Undistorter&&) noexcept;

  /// The camera of the undistorted images, of the same size.
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
