// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// Removes the lens distortion from the images of one camera.
///
/// The undistorted camera has the widest view in which every pixel comes from the distorted image;
/// its focal lengths and principal point therefore differ. Of a fisheye lens it shows at most 70
/// degrees off the optical axis: what is farther out would be stretched over many pixels. Construct
/// one per camera: the maps cost more than an image. Without distortion, images pass through
/// unchanged. Const methods are thread-safe.
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

  /// A window of the undistorted image, at the cost of that window.
  /// @param image 1, 3 or 4 channels, which are interpolated alike.
  /// @param window inside the image.
  /// @throws std::invalid_argument if the image or the window does not fit the camera.
  Image8 undistort(const Image8View& image, const PixelWindow& window) const;

 private:
  struct Maps;
  Camera undistorted_;
  std::unique_ptr<Maps> maps_;  // null without distortion
};

/// The order of the channels of a camera image.
enum class PixelFormat { kGrey, kRgb, kBgr, kRgba, kBgra };

/// A camera image in its original bytes. Only the windows that are read are undistorted and
/// converted, so that a large image costs no more than the object's part of it. Immutable and
/// thread-safe.
class CameraPixels {
 public:
  /// @param bytes the image, with the channels of `format`. @param owner keeps their memory alive.
  /// @param undistorter of the camera; null: there is no distortion.
  /// @throws std::invalid_argument if the bytes do not fit the format or the undistorter.
  CameraPixels(const Image8View& bytes, PixelFormat format, std::shared_ptr<const void> owner,
               std::shared_ptr<const Undistorter> undistorter = nullptr);

  int width() const { return bytes_.width; }
  int height() const { return bytes_.height; }

  /// An undistorted window as RGB, [window.height][window.width][3]; grey has three equal channels.
  /// @throws std::invalid_argument if the window extends beyond the image.
  Image8 read(const PixelWindow& window) const;

  /// The same into memory that is there. @param rgb room for the window's pixels, 3 bytes each.
  void read(const PixelWindow& window, std::uint8_t* rgb) const;

 private:
  void requireInside(const PixelWindow& window) const;

  Image8View bytes_;
  PixelFormat format_;
  std::shared_ptr<const void> owner_;
  std::shared_ptr<const Undistorter> undistorter_;
};

}  // namespace nerf_pose_refiner
