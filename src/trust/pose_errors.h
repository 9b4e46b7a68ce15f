// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "dataset/dataset.h"
#include "field/field.h"
#include "image/colour.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// A photo as a camera would see it: with something unknown behind the object.
/// @param index of what is behind it.
Observation beforeClutter(const PremultipliedImage& photo, const Camera& camera,
                          std::uint64_t index);

/// Measures how far off poses are that keyframes find, beyond what alignment says by its own
/// account: keyframes from as far beside, and as much nearer or farther, as tracking lets them be,
/// in the light of the views and in other light. Sets the deviations of errors. Turns about an axis
/// from all around which the object looks alike are left out. Where nearly all poses are missed,
/// the deviations are those of a pose that is just right, 5 degrees and 0.05.
/// @param field without such deviations. @throws Cancelled.
void measurePoseErrors(Backend* backend, const LoadedField& field,
                       const std::vector<PosedView>& views, const CancellationToken& cancellation,
                       PoseStatistics* statistics);

/// The deviation s that errors have beside what is expected of each: it solves, for n errors,
///     mean(error^2 / (expected variance + s^2)) = (n - 2) / (1.3 n),
/// where a Gaussian's mean is 1: few errors tell the variance badly, and images to come are less
/// like the model. Unlike with the mean excess, a few errors that were expected to be large do not
/// hide that the others are larger than expected.
class ExcessError {
 public:
  void add(double error, double expected_variance);
  /// @return 0: they are clearly smaller than expected, or fewer than four.
  double deviation() const;

 private:
  struct Error {
    double squared, expected;
  };
  double meanBeside(double variance) const;

  std::vector<Error> errors_;
};

}  // namespace nerf_pose_refiner
