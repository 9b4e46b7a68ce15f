// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>

#include "math/hypothesis_state.h"
#include "math/projection.h"
#include "math/random.h"
#include "math/so3.h"

namespace nerf_pose_refiner {

/// A region of poses around a pose: half widths per axis, uniform.
struct PoseSpread {
  Vec3<double> rotation_rad, translation;
  bool about_object;
  Vec3<double> object_centre;
};

NPR_HOST_DEVICE inline Vec3<double> uniformInBox(const Vec3<double>& half_width, std::uint64_t seed,
                                                 std::uint64_t stream, std::uint64_t counter) {
  return {half_width.x * (2.0 * randomUniform(seed, stream, counter) - 1.0),
          half_width.y * (2.0 * randomUniform(seed, stream, counter + 1) - 1.0),
          half_width.z * (2.0 * randomUniform(seed, stream, counter + 2) - 1.0)};
}

/// The index-th pose around `pose`: rotated, about the object's centre in the axes of O or about
/// the camera in its own, then moved along the axes of O.
NPR_HOST_DEVICE inline CameraPose<double> drawnAround(const CameraPose<double>& pose,
                                                      const PoseSpread& spread, std::uint64_t seed,
                                                      std::uint64_t index) {
  const Mat3<double> turn = expSO3(uniformInBox(spread.rotation_rad, seed, index, 0));
  const Vec3<double> move = uniformInBox(spread.translation, seed, index, 3);
  if (!spread.about_object) return {pose.R * turn, pose.o + move};
  const Vec3<double>& c = spread.object_centre;
  return {turn * pose.R, c + turn * (pose.o - c) + move};
}

/// Whether a hypothesis comes before another: live ones first, the lower loss then, and losses that
/// are not numbers last.
NPR_HOST_DEVICE inline bool isBetter(HypothesisState state_a, double loss_a,
                                     HypothesisState state_b, double loss_b) {
  const bool live_a = state_a == HypothesisState::kLive, live_b = state_b == HypothesisState::kLive;
  if (live_a != live_b) return live_a;
  const bool none_a = loss_a != loss_a, none_b = loss_b != loss_b;
  if (none_a || none_b) return !none_a && none_b;
  return loss_a < loss_b;
}

/// Whether two poses are as good as one. @param rotation_rad, translation nearer ones are; the
/// latter is of the object's centre as the cameras see it.
NPR_HOST_DEVICE inline bool isDuplicate(const CameraPose<double>& a, const CameraPose<double>& b,
                                        const Vec3<double>& object_centre, double rotation_rad,
                                        double translation) {
  const Vec3<double>& c = object_centre;
  const Vec3<double> moved = transposedTimes(a.R, c - a.o) - transposedTimes(b.R, c - b.o);
  if (!(norm(moved) < translation)) return false;
  Mat3<double> turn;  // a.R^T b.R
  for (int k = 0; k < 3; ++k) {
    const Vec3<double> v = transposedTimes(a.R, column(b.R, k));
    turn.m[0][k] = v.x;
    turn.m[1][k] = v.y;
    turn.m[2][k] = v.z;
  }
  return norm(logSO3(turn)) < rotation_rad;
}

}  // namespace nerf_pose_refiner
