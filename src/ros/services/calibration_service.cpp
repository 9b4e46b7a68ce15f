// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/services/calibration_service.h"

#include <algorithm>
#include <exception>
#include <utility>

#include "ros/conversions/pose_conversions.h"
#include "ros/conversions/topics.h"

namespace nerf_pose_refiner {
namespace {

geometry_msgs::Transform toTransformMessage(const Pose& pose) {
  geometry_msgs::PoseStamped stamped;
  stamped.pose = toMessage(pose);
  return toTransform(stamped, "").transform;
}

}  // namespace

CalibrationService::CalibrationService(ros::NodeHandle pnh, const std::vector<std::string>& cameras,
                                       Calibrate calibrate)
    : cameras_(cameras), calibrate_(std::move(calibrate)) {
  server_ = pnh.advertiseService(topics::kCalibrate, &CalibrationService::onCall, this);
}

bool CalibrationService::onCall(CalibrateCamera::Request& request,
                                CalibrateCamera::Response& response) {
  answer(request, &response);
  return true;
}

void CalibrationService::answer(const CalibrateCamera::Request& request,
                                CalibrateCamera::Response* response) const {
  const auto named = request.camera.empty()
                         ? cameras_.begin()
                         : std::find(cameras_.begin(), cameras_.end(), request.camera);
  if (named == cameras_.end()) {
    response->message = "~cameras/topics does not name '" + request.camera + "'";
    return;
  }
  CalibrationSettings settings;
  if (request.min_poses > 0) {
    settings.min_sightings = static_cast<int>(std::min<std::uint32_t>(request.min_poses, 10000));
  }
  try {
    Pose stated;
    const auto number = static_cast<std::size_t>(named - cameras_.begin()) + 1;
    const CameraCalibration found = calibrate_(number, settings, &stated);
    response->success = found.success;
    response->message = found.message;
    response->poses = static_cast<std::uint32_t>(found.sightings);
    response->stated.transform = toTransformMessage(stated);
    response->refined.transform = toTransformMessage(found.T_C_V);
    response->covariance = toMessage(found.covariance);
    response->unseen = found.unseen;
    response->misfit = found.misfit;
  } catch (const std::exception& error) {
    response->message = error.what();
  }
}

}  // namespace nerf_pose_refiner
