// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "backend/keyframe_aligner.h"

namespace nerf_pose_refiner {

/// How far a pose is from what a keyframe shows.
struct ViewDistance {
  double rotation_rad = 0;  ///< between the lines of sight to the object's centre
  double scale = 0;         ///< |log| of the ratio of the distances to it
};

/// Between two poses of the camera. @param centre of the object.
ViewDistance viewDistance(const Pose& a_T_O_C, const Pose& b_T_O_C, const Eigen::Vector3d& centre);
ViewDistance viewDistance(const KeyframePoints& keyframe, const Pose& T_O_C);

/// Keyframes of one object in the memory of an aligner.
class KeyframeSet {
 public:
  /// A keyframe and its number in the aligner.
  struct Entry {
    int number;
    std::shared_ptr<const KeyframePoints> keyframe;
    std::uint64_t used;         ///< by the count of uses: when it was the nearest one last
    Eigen::Vector3d direction;  ///< from the object's centre to the camera, of length 1
  };

  /// @param aligner lives longer. @param capacity >= 1: the one that was not used for longest goes.
  /// @param reach of alignment: keyframes that are farther off are of no use.
  KeyframeSet(KeyframeAligner* aligner, int capacity, const ViewDistance& reach)
      : aligner_(aligner), capacity_(capacity), reach_(reach) {}

  void add(std::shared_ptr<const KeyframePoints> keyframe);

  /// The keyframe that shows the object most as a pose does; null: none within reach.
  const Entry* nearest(const Pose& T_O_C);

  /// The nearest one but for a given one that shows the object from at least so far beside a
  /// pose; null: there is none within reach.
  const Entry* beside(const Pose& T_O_C, const KeyframePoints& excluded,
                      double least_rotation_rad) const;

  std::size_t size() const { return entries_.size(); }

 private:
  double costOf(const Entry& entry, const Pose& T_O_C) const;

  KeyframeAligner* aligner_;
  int capacity_;
  ViewDistance reach_;
  std::vector<Entry> entries_;
  std::uint64_t uses_ = 0;
};

}  // namespace nerf_pose_refiner
