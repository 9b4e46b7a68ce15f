// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "backend/keyframe_points.h"
#include "nerf_pose_refiner/backend.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "views/keyframe.h"

namespace nerf_pose_refiner {

struct ViewBankSettings {
  int views = 162;      ///< from all around: some 16 degrees apart
  int object_px = 100;  ///< that the object's diameter spans
  double distance = 4;  ///< of the camera from the object's centre [diameters]
  KeyframeSettings keyframe = {3, 128, 1, 8, 3, 700, 120, 2500, 0.97f, 4};

  /// @throws std::invalid_argument naming the value that is out of range.
  void validate() const;
};

/// Small keyframes of an object from all around, each made when it is first asked for: where the
/// search for an object begins. One thread at a time.
class ViewBank {
 public:
  ViewBank(std::shared_ptr<const LoadedField> field, const ViewBankSettings& settings);

  /// Numbers of the views that see the object from at most so far beside a pose, by the angle
  /// between the lines of sight to its centre; the nearest one at least.
  std::vector<int> around(const Pose& T_O_C, double angle_rad) const;

  /// A view; rendered if this was not yet done. @throws Cancelled.
  std::shared_ptr<const KeyframePoints> view(int number, const CancellationToken& cancellation);

  /// Of the views made so far.
  std::size_t memory_bytes() const;

 private:
  Pose poseOf(int number) const;

  std::shared_ptr<const LoadedField> field_;
  ViewBankSettings settings_;
  std::vector<Eigen::Vector3d> directions_;  // from the object's centre to the camera, in O
  std::vector<std::shared_ptr<const KeyframePoints>> views_;  // null: not made yet
};

/// What a keyframe takes.
std::size_t memoryBytes(const KeyframePoints& keyframe);

}  // namespace nerf_pose_refiner
