// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <utility>

#include "field/field.h"
#include "refinement/aside_alignment.h"
#include "refinement/keyframe_search.h"
#include "refinement/sighting_log.h"
#include "refinement/timed_observation.h"

namespace nerf_pose_refiner {

/// What poses score in an image that are wrong: the one that was found, rolled about the line of
/// sight, and aligned from there. In clutter, and where an object is plain, these score nearly as
/// well as the one that was found, whose own score then proves little.
class RolledScores {
 public:
  /// Rolls by 45, 90, ..., 315 degrees.
  static constexpr int kRolls = 7;

  /// @param look_alikes beside the object's symmetries: what may be taken for the pose that was
  /// found says nothing of it. @param aside where single rolls are tried.
  RolledScores(const FieldMetadata& object, const LookAlikes& look_alikes,
               std::unique_ptr<AsideAlignment> aside)
      : object_(object), look_alikes_(look_alikes), aside_(std::move(aside)) {}

  /// Tries all rolls in an image. @throws Cancelled.
  void tryAll(const TimedObservation& image, const Hypothesis& found, KeyframeSearch* search,
              const CancellationToken& cancellation);

  /// Begins to try one of them beside tracking, each in its turn, unless one is being tried. The
  /// others keep what they scored in images of the last 1.1 s.
  /// @param keyframe the nearest one; null: there is none.
  void tryNext(const TimedObservation& image, const Hypothesis& found,
               const std::shared_ptr<const KeyframePoints>& keyframe);

  /// Takes what tryNext began, which joins those of the image that it was begun in.
  /// @param wait until it is there; false: only if it is. @throws Cancelled.
  void takeTried(bool wait, const CancellationToken& cancellation);

  /// When one was tried last, by the stamp of its image; nothing: never.
  std::optional<std::int64_t> last_ns() const { return last_ns_; }

  /// The best score, 0..1, of those that are not like a pose in an image of a time. Nothing: there
  /// are too few.
  std::optional<double> bestBeside(const Pose& T_O_C, std::int64_t stamp_ns) const;

 private:
  /// Where a roll ended.
  struct End {
    std::int64_t stamp_ns;
    Pose motion;  ///< from the pose that was found there, in O: the object moves on meanwhile
    double score;
  };

  /// A roll that is being tried.
  struct Trial {
    int roll;
    std::int64_t stamp_ns;
    Pose found_T_O_C;
    bool is_valid = true;  ///< false: the object has been looked for anew since then
  };

  void forgetAfterJump(const Pose& T_O_C);
  Pose rolled(int roll, const Pose& T_O_C) const;
  void note(const Trial& trial, const Hypothesis& end);

  const FieldMetadata& object_;
  LookAlikes look_alikes_;
  std::array<std::optional<End>, kRolls>
      ends_;  // nothing: the image does not show the object there
  std::optional<std::int64_t> last_ns_;
  std::optional<Pose> last_T_O_C_;  // that was found there
  int next_ = 0;
  std::optional<Trial> trial_;
  std::unique_ptr<AsideAlignment> aside_;
};

/// A camera that has turned about its line of sight to a point. @param T_O_C its pose.
Pose rolledAbout(const Eigen::Vector3d& point, double angle_rad, const Pose& T_O_C);

}  // namespace nerf_pose_refiner
