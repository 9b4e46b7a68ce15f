// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros_targets.h"

#include <boost/make_shared.hpp>

#include <vector>

#include "message_bytes.h"
#include "ros/conversions/detection_boxes.h"
#include "ros/conversions/pose_conversions.h"
#include "tracking/prior.h"
#include "use_messages.h"

namespace nerf_pose_refiner {
namespace {

/// Has a scale, and an axis of symmetry.
FieldMetadata someObject() {
  FieldMetadata object;
  object.centre = {0.1, 0.2, 0.3};
  object.diameter = 2;
  object.metres_per_unit = 0.1;
  object.symmetries = Symmetries(SymmetryAxis{{0, 0, 1}, {0.1, 0.2, 0}}, {});
  return object;
}

}  // namespace

void fuzzCameraMessages(const std::uint8_t* data, std::size_t size) {
  MessageBytes bytes(data, size);
  const auto flags = bytes.take<std::uint8_t>();
  CameraInput input((flags & 1) != 0);
  for (int i = 0; i < 3 && !bytes.empty(); ++i) {  // the camera may change
    const sensor_msgs::CameraInfo info = bytes.takeCameraInfo();
    const auto image = boost::make_shared<sensor_msgs::Image>(bytes.takeImage());
    ImageMasks masks;
    if (flags & 2) masks.object = boost::make_shared<sensor_msgs::Image>(bytes.takeImage());
    if (flags & 4) masks.ignored = boost::make_shared<sensor_msgs::Image>(bytes.takeImage());
    observe(&input, image, info, masks);
    useOrRefuse([&] {
      checkImage(*image, cameraFromMessage(info, (flags & 1) != 0).camera);
      rgbPixels(*image);
    });
  }
}

void fuzzDetections(const std::uint8_t* data, std::size_t size) {
  MessageBytes bytes(data, size);
  const auto class_id = bytes.take<std::int8_t>();
  const sensor_msgs::CameraInfo info = bytes.takeCameraInfo();
  const auto image = boost::make_shared<sensor_msgs::Image>(bytes.takeImage());
  std::vector<std::uint8_t> rest = bytes.takeAll();
  rest.reserve(1);  // roscpp's buffers are never null
  DetectionArray detections;
  try {
    ros::serialization::IStream stream(rest.data(), static_cast<std::uint32_t>(rest.size()));
    ros::serialization::deserialize(stream, detections);
  } catch (const ros::serialization::StreamOverrunException&) {
    return;
  }
  CameraInput input(false);
  useOrRefuse([&] {
    ImageMasks masks;
    masks.boxes = boxesOf(detections, class_id).boxes;
    input.observe(image, info, masks).validate();
  });
}

void fuzzInitialPose(const std::uint8_t* data, std::size_t size) {
  static const FieldMetadata object = someObject();
  MessageBytes bytes(data, size);
  const geometry_msgs::PoseWithCovarianceStamped message = bytes.takePose();
  SearchSettings settings;
  settings.rotation_deg = 15;
  settings.translation = 0.15;
  const auto use = [&](const TimedPose& start) {
    requireSense(start.T_P_U.isFinite() && !start.frame_id.empty(), "an initial pose");
    priorFrom(start, start.T_P_U, object, settings).validate();
  };
  useOrRefuse([&] { use(initialPoseFrom(withoutCovariance(message))); });
  useOrRefuse([&] { use(initialPoseFrom(message)); });
}

}  // namespace nerf_pose_refiner
