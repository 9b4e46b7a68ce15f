// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "dataset/dataset.h"
#include "field/field.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// A view as a camera would see it: with something unknown behind the object.
/// @param index of what is behind it.
Observation beforeClutter(const PosedView& view, std::uint64_t index);

/// Measures how far off poses are that keyframes find, beyond what alignment says by its own
/// account: keyframes from as far beside, and as much nearer or farther, as tracking lets them be,
/// in the light of the views and in other light. Sets the deviations of errors. Turns about an axis
/// from all around which the object looks alike are left out.
/// @param field without such deviations. @throws Cancelled.
void measurePoseErrors(Backend* backend, const LoadedField& field,
                       const std::vector<PosedView>& views, const CancellationToken& cancellation,
                       PoseStatistics* statistics);

/// The deviation that errors have beside what is expected of each: s so that the mean of
/// error^2 / (expected variance + s^2) is what a Gaussian's is, and a little less, as images to
/// come are less like the model. Unlike the mean excess, a few errors that were expected to be
/// large do not hide that the others are too.
class ExcessError {
 public:
  void add(double error, double expected_variance);
  /// @return 0: none are larger than expected, or there are too few.
  double deviation() const;

 private:
  struct Error {
    double squared, expected;
  };
  double meanBeside(double variance) const;

  std::vector<Error> errors_;
};

}  // namespace nerf_pose_refiner
