// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <memory>
#include <optional>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/observation.h"
#include "nerf_pose_refiner/undistorter.h"

namespace nerf_pose_refiner {

/// The camera that took an image, and how its lens bends it.
struct CameraModel {
  Camera camera;
  Distortion distortion;  ///< empty for a rectified image
};

/// Reads camera_info, with its binning and region of interest (REP-104).
/// @param rectified the image is rectified: P counts; otherwise K and D.
/// @throws InputError if the camera is not calibrated, is the right one of a stereo pair, or has a
/// distortion model other than plumb_bob, rational_polynomial and equidistant; the message names
/// what converts.
CameraModel cameraFromMessage(const sensor_msgs::CameraInfo& info, bool rectified);

/// Whether an image can be used at all, without looking at its pixels.
/// @throws InputError if it has no stamp or frame, has an encoding other than rgb8, bgr8, rgba8,
/// bgra8 and mono8, holds more or less data than its size says, or is not of the camera's size. For
/// other encodings the message names what converts.
void checkImage(const sensor_msgs::Image& image, const Camera& camera);

/// The pixels of an image that passed checkImage as they are, RGB.
Image8 rgbPixels(const sensor_msgs::Image& image);

/// 255 where a mask is not zero, else 0, [h][w][1]. @param what it is called in messages.
/// @throws InputError if it is not mono8 or not of the camera's size.
Image8 maskPixels(const char* what, const sensor_msgs::Image& mask, const Camera& camera);

/// camera_info of an undistorted image.
sensor_msgs::CameraInfo toMessage(const Camera& camera);

/// What else is known of an image, pixel by pixel: mono8, of its size; raw if it is. Each may be
/// null.
struct ImageMasks {
  sensor_msgs::ImageConstPtr object;   ///< not zero: shows the object
  sensor_msgs::ImageConstPtr ignored;  ///< not zero: to be left out, the robot's gripper say
};

/// Images of a camera as observations for the refiner: RGB, undistorted, with an unknown
/// background or a mask. Keeps the undistortion maps from one image to the next. One thread at a
/// time.
class CameraInput {
 public:
  explicit CameraInput(bool rectified) : rectified_(rectified) {}

  /// @throws InputError as cameraFromMessage and checkImage, and for a mask that is not mono8 or
  /// not of the image's size.
  Observation observe(const sensor_msgs::Image& image, const sensor_msgs::CameraInfo& info,
                      const ImageMasks& masks = {});

 private:
  const Undistorter& undistorterOf(const CameraModel& model);

  bool rectified_;
  CameraModel model_;  ///< what undistorter_ was made for
  std::optional<Undistorter> undistorter_;
};

}  // namespace nerf_pose_refiner
