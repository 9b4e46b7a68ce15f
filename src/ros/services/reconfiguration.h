// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <ros/node_handle.h>

#include <functional>
#include <memory>

#include "ros/conversions/parameters.h"

namespace nerf_pose_refiner {

/// What may change between two images, through dynamic_reconfigure: one server for the top level
/// and one for each of the groups ~refiner, ~tracker and ~overlay, so that each parameter has one
/// name, wherever it is set.
///
/// What is not in order together (PoseRefinerParameters::validate) is refused: the server goes back
/// to what was before.
class Reconfiguration {
 public:
  using OnChange = std::function<void(const PoseRefinerParameters&)>;

  /// Talks to the master for each parameter, which takes a while: not for onInit.
  /// @param on_change called on the callback queue of `pnh` with all parameters, changed ones and
  /// others.
  Reconfiguration(const ros::NodeHandle& pnh, const PoseRefinerParameters& parameters,
                  OnChange on_change);
  ~Reconfiguration();

 private:
  struct Servers;
  std::unique_ptr<Servers> servers_;
};

}  // namespace nerf_pose_refiner
