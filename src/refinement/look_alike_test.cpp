// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/look_alike_test.h"

#include <utility>

#include "refinement/look_alike_poses.h"

namespace nerf_pose_refiner {

// Turns by -180 and by 180 degrees are one, and a turn by 0 is none: these are not rendered.
LookAlikeTest::LookAlikeTest(ObjectImage image, const Pose& T_O_C, const LookAlikes& look_alikes)
    : comparison_(std::move(image)), poses_({T_O_C}), motions_(look_alikes.motions.size()) {
  if (look_alikes.axis) {
    const std::vector<double>& turns = triedTurns_rad();
    for (std::size_t i = 1; i < turns.size(); ++i) {
      if (turns[i] != 0) poses_.push_back(turnAbout(*look_alikes.axis, turns[i]) * T_O_C);
    }
  }
  for (const Pose& motion : look_alikes.motions) poses_.push_back(motion * T_O_C);
}

bool LookAlikeTest::step(const LoadedField& field, const CancellationToken& cancellation) {
  const auto next = static_cast<std::size_t>(comparison_.poses());
  if (next >= poses_.size()) return false;
  comparison_.add(
      field.render({comparison_.camera(), poses_[next]}, RenderOptions(), cancellation));
  return next + 1 < poses_.size();
}

void LookAlikeTest::finish(const LoadedField& field, const CancellationToken& cancellation) {
  comparison_.addAll(field, {poses_.begin() + comparison_.poses(), poses_.end()}, cancellation);
}

LookAlikeEvidence LookAlikeTest::evidence(double noise) const {
  LookAlikeEvidence evidence;
  const auto against = [&](std::size_t pose) {
    return comparison_.of(0, static_cast<int>(pose), noise);
  };
  const std::size_t first_motion = poses_.size() - motions_;
  if (first_motion > 1) {
    std::size_t next = 1;
    for (const double turn : triedTurns_rad()) {
      const bool is_rendered = turn != 0 && !evidence.turns.empty();
      if (evidence.turns.empty()) {
        evidence.turns.push_back(against(first_motion - 1));  // -180 degrees
      } else {
        evidence.turns.push_back(is_rendered ? against(next++) : 0);
      }
    }
  }
  for (std::size_t i = first_motion; i < poses_.size(); ++i) evidence.motions.push_back(against(i));
  return evidence;
}

}  // namespace nerf_pose_refiner
