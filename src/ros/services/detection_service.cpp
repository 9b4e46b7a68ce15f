// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/services/detection_service.h"

#include <ros/console.h>

#include <stdexcept>
#include <utility>

#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/status.h"
#include "ros/conversions/topics.h"
#include "ros/services/image_call.h"

namespace nerf_pose_refiner {
namespace {

/// @throws std::invalid_argument.
DetectorOptions optionsOf(const DetectObject::Request& request,
                          const PoseRefinerParameters& parameters) {
  constexpr std::uint32_t kMaxInstances = 1000;
  if (request.max_instances > kMaxInstances) {
    throw std::invalid_argument("max_instances is " + std::to_string(request.max_instances) +
                                " but may be at most " + std::to_string(kMaxInstances));
  }
  DetectorOptions options;
  options.trust_score = parameters.tracker.rules.trust_score;
  if (request.max_instances > 0) options.max_instances = static_cast<int>(request.max_instances);
  return options;
}

/// @param T_W_C the camera in the frame of the result [m].
ObjectDetection messageOf(const Detection& found, const Pose& T_W_C) {
  Eigen::Matrix<double, 6, 6> turn = Eigen::Matrix<double, 6, 6>::Zero();
  turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = T_W_C.R;
  ObjectDetection message;
  message.pose.pose = toMessage(T_W_C * found.T_C_O);
  Eigen::Map<Eigen::Matrix<double, 6, 6, Eigen::RowMajor>>(message.pose.covariance.data()) =
      turn * found.covariance * turn.transpose();
  message.score = static_cast<float>(found.score);
  message.visible_fraction = static_cast<float>(found.visible_fraction);
  return message;
}

}  // namespace

DetectionService::DetectionService(const NodeHandles& nodes,
                                   const PoseRefinerParameters& parameters, FindObject find_object,
                                   Detect detect, tf2::BufferCore& transforms)
    : nodes_(nodes),
      parameters_(parameters),
      find_object_(std::move(find_object)),
      detect_(std::move(detect)),
      input_(parameters.image_is_rectified),
      tf_(transforms, parameters.frames),
      spinner_(1, &queue_) {
  ros::NodeHandle service_nh(nodes.pnh);
  service_nh.setCallbackQueue(&queue_);
  server_ = service_nh.advertiseService(topics::kDetect, &DetectionService::onDetect, this);
  spinner_.start();
}

DetectionService::~DetectionService() {
  cancellation_.requestCancel();
  server_.shutdown();
  spinner_.stop();
}

void DetectionService::change(const PoseRefinerParameters& parameters) {
  std::lock_guard<std::mutex> lock(mutex_);
  parameters_ = parameters;
}

PoseRefinerParameters DetectionService::parameters() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return parameters_;
}

bool DetectionService::onDetect(DetectObject::Request& request, DetectObject::Response& response) {
  const ros::Time called = ros::Time::now();
  const CallEnd end =
      carryOut(request.timeout_s, cancellation_, [&](const CancellationToken& cancellation) {
        answer(request, called, cancellation, &response);
      });
  if (end.failure) {
    response.reason = toMessage(end.failure->reason);
    response.message = end.failure->message;
  }
  if (!response.success) {
    response.message += end.after;
    ROS_WARN("~%s: %s", topics::kDetect, response.message.c_str());
  }
  return true;  // false would lose the message on its way
}

/// @throws InputError for what cannot be used.
void DetectionService::answer(const DetectObject::Request& request, const ros::Time& called,
                              const CancellationToken& cancellation,
                              DetectObject::Response* response) {
  const PoseRefinerParameters current = parameters();
  const DetectorOptions options = optionsOf(request, current);
  const std::shared_ptr<const Field> field = find_object_(request.object);
  if (!(field->metadata.metres_per_unit > 0)) {
    throw InputError(TrackReason::kModelNoScale, "the scale of the model is not known");
  }
  const CameraImage image =
      imageOfCall({boost::make_shared<const sensor_msgs::Image>(request.image),
                   boost::make_shared<const sensor_msgs::CameraInfo>(request.camera_info)},
                  nodes_, current.image_transport, called, cancellation);
  const ImageStamp at = imageStampOf(image.image->header);
  ImageMasks masks;
  if (!request.mask.data.empty()) {
    masks.object = boost::make_shared<const sensor_msgs::Image>(request.mask);
  }
  const Observation observation = input_.observe(image.image, *image.info, masks);
  const Pose T_W_C = tf_.cameraInOutput(at, cancellation);
  const DetectionResult result = detect_(field, options, observation, cancellation);

  response->header = toHeader(at);
  response->header.frame_id = tf_.outputFrame(at.camera_frame);
  for (const Detection& found : result.detections) {
    response->detections.push_back(messageOf(found, T_W_C));
  }
  response->success = !result.detections.empty();
  response->message = result.message;
  if (!response->success) {
    response->reason = toMessage(TrackReason::kLowScore);
  }
}

}  // namespace nerf_pose_refiner
