// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/services/image_service.h"

#include <ros/console.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <future>

#include "ros/services/next_image.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kDefaultTimeout_s = 30;

/// @throws InputError.
double timeoutOf(double requested_s) {
  if (!std::isfinite(requested_s) || requested_s < 0) {
    throw InputError(TrackReason::kNone, "the request's timeout_s is " +
                                             std::to_string(requested_s) + " but must be >= 0");
  }
  return requested_s > 0 ? requested_s : kDefaultTimeout_s;
}

std::string afterSeconds(double s) {
  char text[40];
  std::snprintf(text, sizeof text, " after %g s", s);
  return text;
}

}  // namespace

ImageService::ImageService(const NodeHandles& nodes, const PoseRefinerParameters& parameters,
                           FindObject find_object, tf2::BufferCore& transforms)
    : nodes_(nodes),
      parameters_(parameters),
      find_object_(std::move(find_object)),
      input_(parameters.image_is_rectified, parameters.depth),
      tf_(transforms, parameters.frames),
      spinner_(1, &queue_) {}

ImageService::~ImageService() {
  closing_.requestCancel();
  server_.shutdown();
  spinner_.stop();
}

void ImageService::change(const PoseRefinerParameters& parameters) {
  std::lock_guard<std::mutex> lock(mutex_);
  parameters_ = parameters;
}

/// Does the work of a call in a thread of its own, and watches the time.
ImageService::Outcome ImageService::carryOut(double timeout_s, const std::string& object,
                                             const std::function<void(const ImageCall&)>& work) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = Clock::now();
  ImageCall call;
  call.called = ros::Time::now();
  Outcome outcome;
  try {
    const double limit_s = timeoutOf(timeout_s);
    {
      std::lock_guard<std::mutex> lock(mutex_);
      call.parameters = parameters_;
    }
    std::future<void> done = std::async(std::launch::async, [&] {
      call.object = find_object_(object);
      work(call);
    });
    while (done.wait_for(std::chrono::milliseconds(10)) != std::future_status::ready) {
      if (std::chrono::duration<double>(Clock::now() - start).count() >= limit_s) {
        outcome.after = afterSeconds(limit_s);
      }
      if (!outcome.after.empty() || closing_.cancelRequested()) call.cancellation.requestCancel();
    }
    done.get();
  } catch (const InputError& e) {
    outcome.failure = e;
  } catch (const ModelError& e) {
    outcome.failure.emplace(reasonOf(e), e.what());
  } catch (const Cancelled& e) {
    outcome.failure.emplace(TrackReason::kCancelled, e.what());
  } catch (const std::exception& e) {
    outcome.failure.emplace(TrackReason::kInternal, e.what());
  }
  return outcome;
}

void ImageService::warn(const std::string& service, const std::string& message) const {
  ROS_WARN("~%s: %s", service.c_str(), message.c_str());
}

/// Null: it cannot be used.
std::shared_ptr<const DepthImage> ImageService::depthOf(const Companion& depth,
                                                        const ImageStamp& at,
                                                        const ImageCall& call) const {
  try {
    const Pose T_C_D = tf_.cameraInCamera(imageStampOf(depth.image->header), at, call.cancellation);
    return depthFromMessage(depth.image, *depth.info, T_C_D, call.parameters.depth);
  } catch (const InputError& e) {
    ROS_WARN("depth is not used: %s", e.what());
    return nullptr;
  }
}

ImageOfCall ImageService::imageOf(const sensor_msgs::Image& image,
                                  const sensor_msgs::CameraInfo& info,
                                  const sensor_msgs::Image& mask, const ImageCall& call) {
  const CameraImage seen =
      image.data.empty() ? nextImage(nodes_, call.parameters, call.called, call.cancellation)
                         : CameraImage{boost::make_shared<const sensor_msgs::Image>(image),
                                       boost::make_shared<const sensor_msgs::CameraInfo>(info)};
  ImageMasks masks;
  if (!mask.data.empty()) masks.object = boost::make_shared<const sensor_msgs::Image>(mask);
  ImageOfCall result;
  result.at = imageStampOf(seen.image->header);
  result.observation = input_.observe(seen.image, *seen.info, masks);
  if (seen.depth.image) {
    result.observation.depth = depthOf(seen.depth, result.at, call);
  } else if (image.data.empty() && call.parameters.depth.use &&
             !result.observation.isDepthAlone()) {
    ROS_WARN("depth is not used: none came with the image");
  }
  result.T_W_C = tf_.cameraInOutput(result.at, call.cancellation);
  result.header = toHeader(result.at);
  result.header.frame_id = tf_.outputFrame(result.at.camera_frame);
  return result;
}

}  // namespace nerf_pose_refiner
