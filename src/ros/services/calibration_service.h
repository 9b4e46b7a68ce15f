// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/CalibrateCamera.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>

#include <functional>
#include <string>
#include <vector>

#include "refinement/calibration.h"

namespace nerf_pose_refiner {

/// The service ~calibrate: refines the place of one of ~cameras/topics.
class CalibrationService {
 public:
  /// Refines the place of a camera by its number, 1 or more; tells its stated place. Any thread.
  using Calibrate = std::function<CameraCalibration(std::size_t camera, const CalibrationSettings&,
                                                    Pose* stated)>;

  /// @param cameras topics of the further cameras.
  CalibrationService(ros::NodeHandle pnh, const std::vector<std::string>& cameras,
                     Calibrate calibrate);

  /// Answers a request.
  void answer(const CalibrateCamera::Request& request, CalibrateCamera::Response* response) const;

 private:
  bool onCall(CalibrateCamera::Request& request, CalibrateCamera::Response& response);

  const std::vector<std::string> cameras_;
  const Calibrate calibrate_;
  ros::ServiceServer server_;
};

}  // namespace nerf_pose_refiner
