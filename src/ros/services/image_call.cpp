// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/services/image_call.h"

#include <image_transport/image_transport.h>
#include <ros/callback_queue.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <future>

#include "ros/conversions/status.h"
#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kDefaultTimeout_s = 30;

/// @throws std::invalid_argument.
double timeoutOf(double requested_s) {
  if (!std::isfinite(requested_s) || requested_s < 0) {
    throw std::invalid_argument("timeout_s is " + std::to_string(requested_s) +
                                " but must be >= 0");
  }
  return requested_s > 0 ? requested_s : kDefaultTimeout_s;
}

std::string afterSeconds(double s) {
  char text[40];
  std::snprintf(text, sizeof text, " after %g s", s);
  return text;
}

}  // namespace

CameraImage imageOfCall(const CameraImage& given, const NodeHandles& nodes,
                        const std::string& transport, const ros::Time& called,
                        const CancellationToken& cancellation) {
  if (!given.image->data.empty()) return given;
  ros::CallbackQueue queue;
  ros::NodeHandle nh(nodes.nh);
  nh.setCallbackQueue(&queue);
  CameraImage newest;
  image_transport::ImageTransport images(nh);
  const image_transport::TransportHints hints(transport, ros::TransportHints(), nodes.pnh);
  const image_transport::CameraSubscriber subscriber = images.subscribeCamera(
      nodes.topic(topics::kImage), 10,
      [&](const sensor_msgs::ImageConstPtr& image, const sensor_msgs::CameraInfoConstPtr& info) {
        if (!newest.image && image->header.stamp >= called) newest = {image, info};
      },
      ros::VoidPtr(), hints);
  while (!newest.image && !cancellation.cancelRequested())
    queue.callAvailable(ros::WallDuration(0.02));
  if (newest.image) return newest;
  throw InputError(TrackReason::kNoImages,
                   "no image came that is not older than the call (topic '" +
                       nh.resolveName(nodes.topic(topics::kImage)) + "')");
}

CallEnd carryOut(double timeout_s, const CancellationToken& closing,
                 const std::function<void(const CancellationToken&)>& work) {
  using Clock = std::chrono::steady_clock;
  const Clock::time_point start = Clock::now();
  const CancellationToken cancellation;
  CallEnd end;
  try {
    const double limit_s = timeoutOf(timeout_s);
    // This thread watches the time, another one works.
    std::future<void> done = std::async(std::launch::async, [&] { work(cancellation); });
    while (done.wait_for(std::chrono::milliseconds(10)) != std::future_status::ready) {
      if (std::chrono::duration<double>(Clock::now() - start).count() >= limit_s) {
        end.after = afterSeconds(limit_s);
      }
      if (!end.after.empty() || closing.cancelRequested()) cancellation.requestCancel();
    }
    done.get();
  } catch (const InputError& e) {
    end.failure = CallFailure{e.reason(), e.what()};
  } catch (const ModelError& e) {
    end.failure = CallFailure{reasonOf(e), e.what()};
  } catch (const Cancelled& e) {
    end.failure = CallFailure{TrackReason::kCancelled, e.what()};
  } catch (const std::exception& e) {
    end.failure = CallFailure{TrackReason::kInternal, e.what()};
  }
  return end;
}

}  // namespace nerf_pose_refiner
