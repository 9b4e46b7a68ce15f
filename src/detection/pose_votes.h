// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

struct FieldMetadata;

/// A pose as an image shows it: where the object's centre is seen, how large, and turned how.
struct PoseVote {
  double x = 0, y = 0;     ///< of the object's centre [px]
  double diameter_px = 0;  ///< of the object
  Eigen::Matrix3d R_C_O;
};

/// How far votes for one pose may be apart.
struct VoteTolerance {
  double offset = 0.3;    ///< of the centre [diameters of the object in the image]
  double log_size = 0.4;  ///< of the logarithm of the diameter
  double rotation_rad = 0.6;
};

/// The vote for a pose; nothing if the object is not before the camera.
std::optional<PoseVote> voteFor(const Pose& T_O_C, const Camera& camera,
                                const FieldMetadata& object);

/// Whether two votes may be for one pose.
bool agree(const PoseVote& a, const PoseVote& b, const VoteTolerance& tolerance);

/// Who agrees with whom among votes.
class VoteCounter {
 public:
  VoteCounter(const std::vector<PoseVote>& votes, const VoteTolerance& tolerance);

  /// The vote that most others agree with, itself counted, and those others; empty: none is left.
  std::vector<int> largestGroup() const;
  /// Those of the votes that are left which agree with a vote, itself included.
  std::vector<int> agreeing(int vote) const;
  /// A vote counts no more.
  void remove(int vote);
  /// The votes that count, in order.
  std::vector<int> left() const;

 private:
  std::vector<std::vector<int>> agreeing_;  // with each vote, itself included
  std::vector<int> counts_;                 // of those that are left
  std::vector<char> is_left_;
};

}  // namespace nerf_pose_refiner
