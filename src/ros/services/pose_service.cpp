// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/services/pose_service.h"

#include <ros/console.h>

#include <future>
#include <limits>
#include <utility>

#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/status.h"
#include "ros/conversions/topics.h"
#include "ros/services/image_call.h"

namespace nerf_pose_refiner {
namespace {

/// A track of one image, whatever the age of its initial pose.
TrackerSettings settingsForOneImage(TrackerSettings settings) {
  settings.rules.once = true;
  settings.rules.initial_pose_max_age_s = std::numeric_limits<double>::infinity();
  return settings;
}

/// An estimate as it is for the camera at an image's time. @param T_C_U the same pose there [m].
TimedPose seenFrom(const ImageStamp& image, const TimedPose& estimate, const Pose& T_C_U) {
  TimedPose seen = {T_C_U, image.camera_frame, image.stamp_ns, false, estimate.covariance};
  if (seen.covariance && T_C_U.R != estimate.T_P_U.R) {
    const Eigen::Matrix3d R_C_P = T_C_U.R * estimate.T_P_U.R.transpose();
    Matrix6 turn = Matrix6::Zero();
    turn.topLeftCorner<3, 3>() = turn.bottomRightCorner<3, 3>() = R_C_P;
    seen.covariance = turn * *estimate.covariance * turn.transpose();
  }
  return seen;
}

}  // namespace

PoseService::PoseService(const NodeHandles& nodes, const PoseRefinerParameters& parameters,
                         FindObject find_object, MakeSearch make_search,
                         tf2::BufferCore& transforms)
    : nodes_(nodes),
      parameters_(parameters),
      find_object_(std::move(find_object)),
      make_search_(std::move(make_search)),
      input_(parameters.image_is_rectified),
      tf_(transforms, parameters.frames),
      spinner_(1, &queue_) {
  ros::NodeHandle service_nh(nodes.pnh);
  service_nh.setCallbackQueue(&queue_);
  server_ = service_nh.advertiseService(topics::kRefine, &PoseService::onRefine, this);
  spinner_.start();
}

PoseService::~PoseService() {
  cancellation_.requestCancel();
  server_.shutdown();
  spinner_.stop();
}

void PoseService::change(const PoseRefinerParameters& parameters) {
  std::lock_guard<std::mutex> lock(mutex_);
  parameters_ = parameters;
}

PoseRefinerParameters PoseService::parameters() const {
  std::lock_guard<std::mutex> lock(mutex_);
  return parameters_;
}

bool PoseService::onRefine(RefinePose::Request& request, RefinePose::Response& response) {
  const ros::Time called = ros::Time::now();
  const CallEnd end =
      carryOut(request.timeout_s, cancellation_, [&](const CancellationToken& cancellation) {
        refine(request, called, cancellation, &response);
      });
  if (end.failure) {
    response.reason = toMessage(end.failure->reason);
    response.message = end.failure->message;
  }
  if (!response.success) {
    response.message += end.after;
    ROS_WARN("~%s: %s", topics::kRefine, response.message.c_str());
  }
  return true;  // false would lose the message on its way
}

/// @throws InputError for what cannot be used.
void PoseService::refine(const RefinePose::Request& request, const ros::Time& called,
                         const CancellationToken& cancellation, RefinePose::Response* response) {
  const PoseRefinerParameters current = parameters();
  const TrackerSettings settings = settingsForOneImage(current.tracker);
  const std::shared_ptr<const Field> field = find_object_(request.object);
  const TimedPose given = initialPoseFrom(request.initial);
  const CameraImage image =
      imageOfCall({boost::make_shared<const sensor_msgs::Image>(request.image),
                   boost::make_shared<const sensor_msgs::CameraInfo>(request.camera_info)},
                  nodes_, current.image_transport, called, cancellation);
  const ImageStamp at = imageStampOf(image.image->header);
  ImageMasks masks;
  if (!request.mask.data.empty()) {
    masks.object = boost::make_shared<const sensor_msgs::Image>(request.mask);
  }
  Observation observation = input_.observe(image.image, *image.info, masks);
  const Pose T_W_C = tf_.cameraInOutput(at, cancellation);
  ObjectTracker tracker(make_search_(settings), settings);
  std::future<void> in_use = tracker.offerModel(field);
  tracker.applyModels();
  in_use.get();
  tracker.offer(seenFrom(at, given, tf_.inCamera(given, at, cancellation)));
  const TrackOutcome result =
      tracker.track({at, [&](bool) { return std::move(observation); }, cancellation});

  response->success = result.trusted;
  response->reason = toMessage(result.reason);
  response->message = result.message;
  response->score = static_cast<float>(result.score);
  response->pose.header = toHeader(at);
  response->pose.header.frame_id = tf_.outputFrame(at.camera_frame);
  if (!result.found) return;
  response->pose.pose = toMessage(result.refinement, T_W_C, field->metadata);
  response->hypotheses = toMessage(result.refinement.hypotheses, T_W_C, field->metadata).hypotheses;
}

}  // namespace nerf_pose_refiner
