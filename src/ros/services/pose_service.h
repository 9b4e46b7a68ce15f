// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/RefinePose.h>

#include <functional>
#include <memory>

#include "ros/services/image_service.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {

/// ~refine: one image, one initial pose, one answer.
class PoseService {
 public:
  using MakeSearch = std::function<std::unique_ptr<ObjectSearch>(const TrackerSettings&)>;

  /// @param make_search called for each request, so that no model stays in use.
  /// @param transforms filled by another thread; outlives this object.
  PoseService(const NodeHandles& nodes, const PoseRefinerParameters& parameters,
              FindObject find_object, MakeSearch make_search, tf2::BufferCore& transforms);

  /// Takes over the searches and the rules of tracking, from the next call on. By any thread.
  void change(const PoseRefinerParameters& parameters) { service_.change(parameters); }

 private:
  void refine(const RefinePose::Request& request, const ImageCall& call,
              RefinePose::Response* response);

  MakeSearch make_search_;
  ImageService service_;  // ends first: it calls this object
};

}  // namespace nerf_pose_refiner
