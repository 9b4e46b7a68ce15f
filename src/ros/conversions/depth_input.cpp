// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/depth_input.h"

#include <sensor_msgs/image_encodings.h>

#include <string>

#include "ros/conversions/camera_input.h"
#include "tracking/status.h"

namespace nerf_pose_refiner {
namespace {

bool isLittleEndian() {
  const std::uint16_t one = 1;
  return *reinterpret_cast<const std::uint8_t*>(&one) == 1;
}

DepthImage::Format formatOfDepth(const std::string& encoding) {
  namespace encodings = sensor_msgs::image_encodings;
  if (encoding == encodings::TYPE_32FC1) return DepthImage::Format::kFloat;
  if (encoding == encodings::TYPE_16UC1 || encoding == encodings::MONO16) {
    return DepthImage::Format::kUint16;
  }
  throw InputError(TrackReason::kBadImage,
                   "the encoding of the depth image is '" + encoding + "', not 16UC1 or 32FC1");
}

/// All but the pixels' owner, the place and the noise. @throws InputError.
DepthImage checkedDepth(const sensor_msgs::Image& image, const sensor_msgs::CameraInfo& info,
                        const DepthSettings& settings) {
  DepthImage depth;
  depth.format = formatOfDepth(image.encoding);
  if ((image.is_bigendian != 0) == isLittleEndian()) {
    throw InputError(TrackReason::kBadImage,
                     "the depth image has the byte order of another kind of machine");
  }
  const CameraModel model = cameraFromMessage(info, settings.is_rectified);
  if (!model.distortion.isZero()) {
    throw InputError(TrackReason::kBadCameraInfo,
                     "the depth camera's lens distorts: let image_proc/rectify take that out "
                     "(without interpolation) and set ~depth/is_rectified");
  }
  depth.camera = model.camera;
  const bool fits = static_cast<int>(image.width) == model.camera.width &&
                    static_cast<int>(image.height) == model.camera.height &&
                    image.data.size() == std::size_t{image.step} * image.height;
  if (!fits) {
    throw InputError(
        TrackReason::kBadCameraInfo,
        "the depth image is " + std::to_string(image.width) + " x " + std::to_string(image.height) +
            " with " + std::to_string(image.data.size()) + " bytes, its camera_info is for " +
            std::to_string(model.camera.width) + " x " + std::to_string(model.camera.height));
  }
  depth.data = image.data.data();
  depth.row_bytes = image.step;
  depth.unit_m = settings.unit_m;
  depth.noise = settings.noise;
  try {
    depth.validate();
  } catch (const std::invalid_argument& e) {
    throw InputError(TrackReason::kBadImage, "depth image (" + image.encoding + "): " + e.what());
  }
  return depth;
}

}  // namespace

bool isDepthImage(const sensor_msgs::Image& image) {
  namespace encodings = sensor_msgs::image_encodings;
  return image.encoding == encodings::TYPE_32FC1 || image.encoding == encodings::TYPE_16UC1;
}

void checkDepthImage(const sensor_msgs::Image& image, const sensor_msgs::CameraInfo& info,
                     const DepthSettings& settings) {
  requireStampAndFrame(image);
  checkedDepth(image, info, settings);
}

std::shared_ptr<const DepthImage> depthFromMessage(const sensor_msgs::ImageConstPtr& image,
                                                   const sensor_msgs::CameraInfo& info,
                                                   const Pose& T_C_D,
                                                   const DepthSettings& settings) {
  DepthImage depth = checkedDepth(*image, info, settings);
  depth.owner = std::shared_ptr<const void>(image.get(), [image](const void*) {});
  depth.T_C_D = T_C_D;
  return std::make_shared<const DepthImage>(std::move(depth));
}

}  // namespace nerf_pose_refiner
