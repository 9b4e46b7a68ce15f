// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "backend/keyframe_points.h"
#include "refinement/field_refiner.h"
#include "refinement/look_alike_belief.h"
#include "refinement/look_alike_test.h"
#include "refinement/timed_observation.h"
#include "views/keyframe_renderer.h"

namespace nerf_pose_refiner {

/// Watches over a track of an object that may be taken for itself: whether the pose that is tracked
/// is the right one of those that look alike. Tests of a tracked pose run in the thread that
/// renders keyframes: while it has nothing else to do, or in turns with keyframes if nobody knows
/// which pose is the right one.
class LookAlikeWatch {
 public:
  LookAlikeWatch(std::shared_ptr<const LoadedField> field, const LookAlikes& look_alikes);

  /// A first pose, found within a prior. Renders. @throws Cancelled.
  void begin(const Observation& observation, const Pose& T_O_C, const Prior& prior,
             const CancellationToken& cancellation);

  /// What was believed of the object's pose, and a test that is under way, are of no use any more.
  void forget();

  /// A pose that tracking found, without a sudden turn about the axis that the image does not ask
  /// for: what covers the object drags it along where it is held least.
  /// @param expected where the object was predicted. @param keyframe from near the pose.
  Pose steadied(const Observation& observation, const Pose& expected, const Pose& found,
                const KeyframePoints& keyframe);
  /// The motion near a given one that takes a pose to where the image shows the object. Renders.
  /// Nothing: none is clearly better than the pose itself. @throws Cancelled.
  std::optional<Pose> confirmed(const Observation& observation, const Pose& T_O_C,
                                const Pose& motion, const CancellationToken& cancellation) const;
  /// A pose without its turn about the axis from another one: what aligns a pose holds this turn
  /// least.
  Pose withTurnOf(const Pose& other, const Pose& T_O_C) const;
  /// A tracked pose. What was tested before is taken into account from its time on.
  /// @param is_sure the image shows the object there, whichever way it is turned.
  void goOn(std::int64_t stamp_ns, const Pose& T_O_C, bool is_sure);
  /// The result of a test, if one is due. @param wait if it is not done yet.
  void takeTest(std::int64_t stamp_ns, bool wait, KeyframeRenderer* renderer,
                const CancellationToken& cancellation);
  /// Ends a test that is under way, without a result.
  void giveTestUp(KeyframeRenderer* renderer);
  /// Tests a tracked pose, or lets the test that is under way go on, unless that is too old.
  /// @param is_sure @see goOn.
  void maybeTest(const TimedObservation& image, const Pose& T_O_C, bool is_sure,
                 KeyframeRenderer* renderer);

  /// The motion from the pose to a much likelier one, @see LookAlikeBelief::better. Nothing: there
  /// is none.
  std::optional<Pose> better() const;
  /// The same for a pose that does not explain the image, by the last test alone.
  const std::optional<Pose>& guess() const { return guess_; }
  void moveBy(const Pose& motion);

  /// Adds to a result what is uncertain for look-alikes: `unmistaken`, the turn's variance, and the
  /// other poses.
  void judge(Refinement* found) const;

 private:
  struct Test;

  void use(const Test& test);
  bool isTesting(std::int64_t stamp_ns) const;
  void beginTest(const TimedObservation& image, const Pose& T_O_C, bool is_sure,
                 KeyframeRenderer* renderer);

  std::shared_ptr<const LoadedField> field_;
  LookAlikes look_alikes_;
  std::optional<LookAlikeBelief> belief_;
  std::optional<Pose> guess_;
  std::optional<std::pair<std::int64_t, Pose>> last_;  ///< pose that was tracked last
  double unexpected_rad_ = 0;   ///< turns that were not predicted, since the last test
  bool holds_ = true;           ///< the last test: the image fixes the turn
  std::shared_ptr<Test> test_;  ///< under way; null: none
  std::int64_t due_ns_ = 0;     ///< when its result is used
};

}  // namespace nerf_pose_refiner
