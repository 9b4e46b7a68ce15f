// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <functional>
#include <optional>

#include "backend/backend.h"
#include "dataset/dataset.h"
#include "nerf_pose_refiner/registration.h"

namespace nerf_pose_refiner {

/// A dataset of views of one exposure.
struct EqualColours {
  Dataset dataset;
  /// Of the exposures before (@see gainSpread); 0: they are left as they are. Nothing: they were
  /// not compared, as the settings say, or could not be: of few photos, or in a short time.
  std::optional<double> spread;
  double seconds = 0;  ///< that it took
};

/// Makes the views' exposures equal, if they differ (@see photoGains) and `keep_colours` does not
/// forbid it. They are compared with a model that is learned in a short time and knows no
/// directions. What a shiny object shows differently from each direction is left as it is: a model
/// with directions foretells it for views that it has not seen, but no exposure.
/// @throws Cancelled.
EqualColours withEqualColours(Backend* backend, const Dataset& dataset,
                              const RegistrationOptions& settings,
                              const std::function<void(const RegistrationProgress&)>& progress,
                              const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
