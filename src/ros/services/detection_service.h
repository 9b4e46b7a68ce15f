// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/DetectObject.h>
#include <ros/publisher.h>

#include <functional>
#include <memory>

#include "nerf_pose_refiner/detector.h"
#include "ros/services/image_service.h"

namespace nerf_pose_refiner {

/// ~detect: one image, all instances of an object in it. What was found last is shown in RViz, too.
class DetectionService {
 public:
  /// Detector, made for one call so that no model stays in use. @param options without a path.
  using Detect = std::function<DetectionResult(
      const std::shared_ptr<const Field>& field, const DetectorOptions& options,
      const Observation& observation, const CancellationToken& cancellation)>;

  /// @param detect called by one thread after the other.
  /// @param transforms filled by another thread; outlives this object.
  DetectionService(const NodeHandles& nodes, const PoseRefinerParameters& parameters,
                   FindObject find_object, Detect detect, tf2::BufferCore& transforms);

  /// Takes over the rules of tracking, from the next call on. By any thread.
  void change(const PoseRefinerParameters& parameters) { service_.change(parameters); }

 private:
  void detect(const DetectObject::Request& request, const ImageCall& call,
              DetectObject::Response* response);

  Detect detect_;
  ros::Publisher markers_;
  ImageService service_;  // ends first: it calls this object
};

}  // namespace nerf_pose_refiner
