// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/time.h>
#include <sensor_msgs/CameraInfo.h>
#include <sensor_msgs/Image.h>

#include <functional>
#include <optional>
#include <string>

#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/track_status.h"
#include "ros/conversions/node_handles.h"

namespace nerf_pose_refiner {

// What services have in common that answer about one image.

/// An image and its camera.
struct CameraImage {
  sensor_msgs::ImageConstPtr image;
  sensor_msgs::CameraInfoConstPtr info;
};

/// The image of a call: the given one, or if that has no data, the first one on the topic that is
/// not older than the call. Listens to the camera for as long as it takes, whether or not the
/// tracking does.
/// @throws InputError if the cancellation comes before an image.
CameraImage imageOfCall(const CameraImage& given, const NodeHandles& nodes,
                        const std::string& transport, const ros::Time& called,
                        const CancellationToken& cancellation);

/// Why a call has no answer.
struct CallFailure {
  TrackReason reason;
  std::string message;
};

/// How a call ended.
struct CallEnd {
  std::optional<CallFailure> failure;
  std::string after;  ///< " after 3 s" if its time was up; else empty
};

/// Does the work of a call in a thread of its own. Its token is cancelled when its time is up or
/// the service closes.
/// @param timeout_s as the call says; 0: 30 s. A negative one is a failure.
CallEnd carryOut(double timeout_s, const CancellationToken& closing,
                 const std::function<void(const CancellationToken&)>& work);

}  // namespace nerf_pose_refiner
