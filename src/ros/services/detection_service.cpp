// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/services/detection_service.h"

#include <string>
#include <utility>

#include "field/object_frame.h"
#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/pose_markers.h"
#include "ros/conversions/status.h"
#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {
namespace {

/// @throws InputError.
DetectorOptions optionsOf(const DetectObject::Request& request,
                          const PoseRefinerParameters& parameters) {
  constexpr std::uint32_t kMaxInstances = 1000;
  if (request.max_instances > kMaxInstances) {
    throw InputError(TrackReason::kNone,
                     "the request's max_instances is " + std::to_string(request.max_instances) +
                         " but may be at most " + std::to_string(kMaxInstances));
  }
  DetectorOptions options;
  options.trust_score = parameters.tracker.rules.trust_score;
  if (request.max_instances > 0) options.max_instances = static_cast<int>(request.max_instances);
  return options;
}

/// @param T_W_C the camera in the frame of the result [m].
ObjectDetection messageOf(const Detection& found, const Pose& T_W_C) {
  ObjectDetection message;
  message.pose.pose = toMessage(T_W_C * found.T_C_O);
  message.pose.covariance = toMessage(rotated(found.covariance, T_W_C.R));
  message.score = static_cast<float>(found.score);
  message.visible_fraction = static_cast<float>(found.visible_fraction);
  return message;
}

}  // namespace

DetectionService::DetectionService(const NodeHandles& nodes,
                                   const PoseRefinerParameters& parameters, FindObject find_object,
                                   Detect detect, tf2::BufferCore& transforms)
    : detect_(std::move(detect)), service_(nodes, parameters, std::move(find_object), transforms) {
  ros::NodeHandle pnh(nodes.pnh);
  markers_ = pnh.advertise<visualization_msgs::MarkerArray>(topics::kDetectionMarkers, 1,
                                                            /*latch=*/true);
  service_.serve<DetectObject::Request, DetectObject::Response>(
      topics::kDetect,
      [this](const DetectObject::Request& request, const ImageCall& call,
             DetectObject::Response* response) { this->detect(request, call, response); });
}

/// @throws InputError for what cannot be used.
void DetectionService::detect(const DetectObject::Request& request, const ImageCall& call,
                              DetectObject::Response* response) {
  const DetectorOptions options = optionsOf(request, call.parameters);
  if (!(call.object->metadata.metres_per_unit > 0)) {
    throw InputError(TrackReason::kModelNoScale, "the scale of the model is not known");
  }
  const ImageOfCall image = service_.imageOf(request, call);
  const DetectionResult result =
      detect_(call.object, options, image.observation, call.cancellation);
  response->header = image.header;
  for (const Detection& found : result.detections) {
    response->detections.push_back(messageOf(found, image.T_W_C));
  }
  const ObjectFrame frame = ObjectFrame::inMetres(call.object->metadata);
  markers_.publish(
      detectionMarkers(response->header, response->detections, boxCorners(*call.object, frame)));
  response->success = !result.detections.empty();
  response->message = result.message;
  if (!response->success) response->reason = toMessage(TrackReason::kLowScore);
}

}  // namespace nerf_pose_refiner
