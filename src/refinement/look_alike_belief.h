// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <vector>

#include "field/field.h"
#include "refinement/look_alike_test.h"

namespace nerf_pose_refiner {

/// How likely a tracked pose is the right one among those that it may be taken for: a density over
/// the turn about the axis from the pose to the true one, and a probability of each other motion.
/// Images change it by their evidence, time makes it wider.
class LookAlikeBelief {
 public:
  /// @param odds of a motion of the object from the pose to the true one, before any image.
  LookAlikeBelief(const LookAlikes& look_alikes, const std::function<double(const Pose&)>& odds);

  /// A pose that is known to be right but for a small turn.
  static LookAlikeBelief known(const LookAlikes& look_alikes);

  void see(const LookAlikeEvidence& evidence);
  /// The turn may have changed. @param deviation_rad about the axis.
  void spread(double deviation_rad);
  /// The pose is another one from now on. @param motion from the old one to it, as `better` said.
  void moveBy(const Pose& motion);

  /// The motion from the pose to a much likelier one; identity: there is none.
  Pose better() const;

  /// Probability that the turn is wrong by less than 5 degrees, and that it is no other motion.
  double right() const;
  /// Variance of the turn, if it is no other motion [rad^2]; 0 without an axis.
  double turnVariance() const;

  /// Likely motions from the pose to others, and their probabilities beside the pose's own; the
  /// likeliest first.
  struct Other {
    Pose motion;
    double probability;
  };
  std::vector<Other> others() const;

 private:
  int cellOf(double turn_rad) const;
  double massAround(int cell, double within_rad) const;
  void normalise();

  LookAlikes look_alikes_;
  std::vector<double> turns_;    ///< probabilities of turns, evenly from 0; of 0 alone: no axis
  std::vector<double> motions_;  ///< probabilities of LookAlikes::motions
};

}  // namespace nerf_pose_refiner
