// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <memory>
#include <optional>
#include <vector>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/observation.h"
#include "nerf_pose_refiner/undistorter.h"
#include "ros/conversions/parameters.h"

namespace nerf_pose_refiner {

/// A camera and its lens distortion.
struct CameraModel {
  Camera camera;
  Distortion distortion;  ///< empty for a rectified image

  friend bool operator==(const CameraModel& a, const CameraModel& b) {
    return a.camera == b.camera && a.distortion == b.distortion;
  }
};

/// Reads camera_info, with its binning and region of interest (REP-104).
/// @param rectified the image is rectified: P applies; otherwise K and D.
/// @throws InputError if the camera is not calibrated, is the right one of a stereo pair, or has a
/// distortion model other than plumb_bob, rational_polynomial and equidistant; the message names a
/// converter.
CameraModel cameraFromMessage(const sensor_msgs::CameraInfo& info, bool rectified);

/// @throws InputError if an image has no stamp or frame.
void requireStampAndFrame(const sensor_msgs::Image& image);

/// Whether a colour or grey image can be used at all, without looking at its pixels.
/// @throws InputError if it has no stamp or frame, has an encoding other than rgb8, bgr8, rgba8,
/// bgra8 and mono8, holds more or less data than its size says, or is not of the camera's size. For
/// other encodings the message names a converter.
void checkImage(const sensor_msgs::Image& image, const Camera& camera);

/// The pixels of an image, as RGB. Requires that it passed checkImage.
Image8 rgbPixels(const sensor_msgs::Image& image);

/// 255 where a mask is non-zero, else 0, [h][w][1]. @param what its name in messages.
/// @throws InputError if it is not mono8 or not of the camera's size.
Image8 maskPixels(const char* what, const sensor_msgs::Image& mask, const Camera& camera);

/// camera_info of an undistorted image.
sensor_msgs::CameraInfo toMessage(const Camera& camera);

/// What others say of where the object is in an image. Masks are mono8 and of the image's size;
/// all is distorted like the image. Each may be null or empty.
struct ImageMasks {
  sensor_msgs::ImageConstPtr object;   ///< non-zero: the pixel shows the object
  sensor_msgs::ImageConstPtr ignored;  ///< non-zero: ignore the pixel (the robot's gripper)
  /// Where a 2-D detector sees the object, best first.
  std::vector<ImageBox> boxes = {};
};

/// Images of a camera as observations for the refiner: RGB, undistorted, with an unknown
/// background or a mask. Inputs of one process that are given the same message give observations of
/// the same pixels, so that the trackers of several objects share what is made of them. Keeps the
/// undistortion maps from one image to the next. Not thread-safe.
class CameraInput {
 public:
  /// @param depth how depth images are read that come in place of colours; nothing: they are
  /// refused.
  explicit CameraInput(bool rectified, const std::optional<DepthSettings>& depth = std::nullopt)
      : rectified_(rectified), depth_(depth) {}

  /// A depth image becomes an observation of depth alone, for which masks and boxes say nothing.
  /// The observation keeps the message, and reads the part of it that is looked at.
  /// @throws InputError as cameraFromMessage, checkImage and depthFromMessage, and for a mask that
  /// is not mono8 or not of the image's size.
  Observation observe(const sensor_msgs::ImageConstPtr& image, const sensor_msgs::CameraInfo& info,
                      const ImageMasks& masks = {});

 private:
  void makeUndistorter(const CameraModel& model);

  bool rectified_;
  std::optional<DepthSettings> depth_;
  CameraModel model_;  ///< of undistorter_
  std::shared_ptr<const Undistorter> undistorter_;
  std::shared_ptr<const CameraPixels> last_;  ///< kept for inputs that are given it later
};

}  // namespace nerf_pose_refiner
