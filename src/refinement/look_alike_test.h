// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/loaded_field.h"
#include "field/field.h"
#include "refinement/pose_evidence.h"

namespace nerf_pose_refiner {

/// What an image says of a pose against those that it may be taken for.
struct LookAlikeEvidence {
  /// Logarithms of the odds of the pose against the same one after a turn of the object, at
  /// triedTurns_rad; empty if there is no axis.
  std::vector<double> turns;
  std::vector<double> motions;  ///< the same for each of LookAlikes::motions
};

/// Renders an object in poses that it may be taken for, one in each step, and compares them with an
/// image.
class LookAlikeTest {
 public:
  /// @param image that shows the object at the pose.
  LookAlikeTest(ObjectImage image, const Pose& T_O_C, const LookAlikes& look_alikes);

  /// Renders the next pose. @return false: there is none left. @throws as LoadedField::render.
  bool step(const LoadedField& field, const CancellationToken& cancellation);

  /// Renders all that are left. @throws as LoadedField::renderAll.
  void finish(const LoadedField& field, const CancellationToken& cancellation);

  /// @pre step returned false, or all is finished. @param noise @see PoseEvidence::of.
  LookAlikeEvidence evidence(double noise) const;

 private:
  PoseEvidence comparison_;
  std::vector<Pose> poses_;  ///< that itself first
  std::size_t motions_;      ///< the last ones
};

}  // namespace nerf_pose_refiner
