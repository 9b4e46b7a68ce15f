// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/services/pose_service.h"

#include <image_transport/image_transport.h>
#include <ros/console.h>

#include <chrono>
#include <cmath>
#include <future>
#include <limits>
#include <utility>

#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/status.h"
#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kDefaultTimeout_s = 30;

/// @throws std::invalid_argument.
double timeoutOf(const RefinePose::Request& request) {
  if (!std::isfinite(request.timeout_s) || request.timeout_s < 0) {
    throw std::invalid_argument("timeout_s is " + std::to_string(request.timeout_s) +
                                " but must be >= 0");
  }
  return request.timeout_s > 0 ? request.timeout_s : kDefaultTimeout_s;
}

std::string seconds(double s) {
  char text[40];
  std::snprintf(text, sizeof text, "%g s", s);
  return text;
}

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
  using Clock = std::chrono::steady_clock;
  const ros::Time called = ros::Time::now();
  const Clock::time_point start = Clock::now();
  const CancellationToken cancellation;
  double timeout_s = 0;
  bool timed_out = false;
  try {
    timeout_s = timeoutOf(request);
    // This thread watches the time, another one works.
    std::future<void> work =
        std::async(std::launch::async, [&] { refine(request, called, cancellation, &response); });
    while (work.wait_for(std::chrono::milliseconds(10)) != std::future_status::ready) {
      timed_out = std::chrono::duration<double>(Clock::now() - start).count() >= timeout_s;
      if (timed_out || cancellation_.cancelRequested()) cancellation.requestCancel();
    }
    work.get();
  } catch (const InputError& e) {
    response.reason = toMessage(e.reason());
    response.message = e.what();
  } catch (const ModelError& e) {
    response.reason = toMessage(reasonOf(e));
    response.message = e.what();
  } catch (const std::exception& e) {
    response.reason = toMessage(TrackReason::kInternal);
    response.message = e.what();
  }
  if (timed_out && !response.success) response.message += " after " + seconds(timeout_s);
  if (!response.success) ROS_WARN("~%s: %s", topics::kRefine, response.message.c_str());
  return true;  // false would lose the message on its way
}

/// @throws InputError for what cannot be used.
void PoseService::refine(const RefinePose::Request& request, const ros::Time& called,
                         const CancellationToken& cancellation, RefinePose::Response* response) {
  const TrackerSettings settings = settingsForOneImage(parameters().tracker);
  const std::shared_ptr<const Field> field = find_object_(request.object);
  const TimedPose given = initialPoseFrom(request.initial);
  const CameraImage image = imageOf(request, called, cancellation);
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

PoseService::CameraImage PoseService::imageOf(const RefinePose::Request& request,
                                              const ros::Time& called,
                                              const CancellationToken& cancellation) const {
  if (request.image.data.empty()) return waitForImage(called, cancellation);
  return {boost::make_shared<const sensor_msgs::Image>(request.image),
          boost::make_shared<const sensor_msgs::CameraInfo>(request.camera_info)};
}

/// Listens to the camera for as long as it takes, whether or not the tracking does.
PoseService::CameraImage PoseService::waitForImage(const ros::Time& called,
                                                   const CancellationToken& cancellation) const {
  ros::CallbackQueue queue;
  ros::NodeHandle nh(nodes_.nh);
  nh.setCallbackQueue(&queue);
  CameraImage newest;
  image_transport::ImageTransport transport(nh);
  const image_transport::TransportHints hints(parameters().image_transport, ros::TransportHints(),
                                              nodes_.pnh);
  const image_transport::CameraSubscriber subscriber = transport.subscribeCamera(
      topics::kImage, 10,
      [&](const sensor_msgs::ImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info) {
        if (!newest.image && image->header.stamp >= called) newest = {image, info};
      },
      ros::VoidPtr(), hints);
  while (!newest.image && !cancellation.cancelRequested())
    queue.callAvailable(ros::WallDuration(0.02));
  if (newest.image) return newest;
  throw InputError(TrackReason::kNoImages,
                   "no image came that is not older than the call (topic '" +
                       nh.resolveName(topics::kImage) + "')");
}

}  // namespace nerf_pose_refiner
