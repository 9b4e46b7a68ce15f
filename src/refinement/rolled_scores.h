// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <optional>

#include "field/field.h"
#include "refinement/keyframe_search.h"

namespace nerf_pose_refiner {

/// What poses score in an image that are wrong for certain: the one that was found, rolled about
/// the line of sight, and aligned from there. In clutter and where an object is plain, these score
/// nearly as well as it does, and its own score proves little.
class RolledScores {
 public:
  /// Rolls by 45, 90, ..., 315 degrees.
  static constexpr int kRolls = 7;

  /// @param look_alikes poses that may be taken for the one that was found say nothing of it.
  RolledScores(const FieldMetadata& object, const LookAlikes& look_alikes)
      : object_(object), look_alikes_(look_alikes) {}

  void forget() { scores_.fill(std::nullopt); }

  /// Tries all rolls in the image that was searched last. @throws Cancelled.
  void tryAll(const Hypothesis& found, KeyframeSearch* search,
              const CancellationToken& cancellation);

  /// Tries one of them, each in its turn; the others keep what they scored in images before.
  /// @throws Cancelled.
  void tryNext(const Hypothesis& found, KeyframeSearch* search,
               const CancellationToken& cancellation);

  /// The best one's score, 0..1. Nothing: too few were tried that did not end at a pose like the
  /// one that was found.
  std::optional<double> best() const;

 private:
  void tryRolls(int first, int count, const Hypothesis& found, KeyframeSearch* search,
                const CancellationToken& cancellation);
  bool isAlike(const Pose& a_T_O_C, const Pose& b_T_O_C) const;

  const FieldMetadata& object_;
  LookAlikes look_alikes_;
  std::array<std::optional<double>, kRolls> scores_;
  int next_ = 0;
};

/// A camera that has turned about its line of sight to a point. @param T_O_C its pose.
Pose rolledAbout(const Eigen::Vector3d& point, double angle_rad, const Pose& T_O_C);

}  // namespace nerf_pose_refiner
