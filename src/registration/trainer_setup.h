// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/backend.h"
#include "backend/training.h"
#include "dataset/dataset.h"
#include "nerf_pose_refiner/registration.h"
#include "registration/visual_hull.h"

namespace nerf_pose_refiner {

/// A rough training has so much fewer steps, and time.
constexpr int kRoughFraction = 4;

/// How far silhouettes may be out of place once poses were corrected. @see visualHull
constexpr double kSlackAfter = 0.015;

struct TrainerKind {
  bool has_alpha;        ///< of the views
  bool is_matt = false;  ///< colours do not depend on the direction
};

/// A trainer as the settings ask for.
///
/// Before backgrounds that change only what is opaque looks right: objects where their photos say
/// so, and scenes everywhere. (An object in a box may end before the background that is seen in the
/// box, too.)
std::unique_ptr<FieldTrainer> trainerOf(Backend* backend, const std::vector<PosedView>& training,
                                        const TrainerKind& kind,
                                        const RegistrationOptions& settings, Hull hull);

/// The visual hull of a dataset's object, at the resolution of the profile's occupancy grid.
/// @throws std::runtime_error if all views look from one direction, unless poor data is accepted.
Hull hullOf(const Dataset& dataset, const RegistrationOptions& settings, double slack,
            const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
