// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/trainer_setup.h"

#include <algorithm>
#include <utility>

#include "registration/data_check.h"

namespace nerf_pose_refiner {
namespace {

/// Whether nothing but the box is seen in any view: it holds a whole scene, not an object in one.
bool fillsViews(const Box& box, const std::vector<PosedView>& views) {
  return std::all_of(views.begin(), views.end(), [&](const PosedView& view) {
    // What shows a convex box is convex: the corners speak for all pixels.
    for (const int x : {0, view.camera.width - 1}) {
      for (const int y : {0, view.camera.height - 1}) {
        if (!box.meets(view.T_O_C.t, view.T_O_C.R * view.camera.direction(x, y))) return false;
      }
    }
    return true;
  });
}

}  // namespace

std::unique_ptr<FieldTrainer> trainerOf(Backend* backend, const std::vector<PosedView>& training,
                                        const TrainerKind& kind,
                                        const RegistrationOptions& settings, Hull hull) {
  TrainingPlan plan;
  plan.samples_per_step = settings.samples_per_step;
  plan.learning_rate = settings.learning_rate;
  plan.final_learning_rate_factor = settings.final_learning_rate_factor;
  plan.region = std::move(hull.region);
  plan.random_background = kind.has_alpha || fillsViews(hull.box, training);
  plan.seed = settings.seed;
  std::vector<TrainingView> views;
  for (const PosedView& view : training) views.push_back({view.rgba, view.camera, view.T_O_C});
  FieldConfig config = FieldConfig::named(settings.profile);
  if (kind.is_matt) config.sh_degree = 1;
  return backend->makeTrainer(config, hull.box, std::move(views), plan);
}

Hull hullOf(const Dataset& dataset, const RegistrationOptions& settings, double slack,
            const CancellationToken& cancellation) {
  const int resolution = FieldConfig::named(settings.profile).occupancy_resolution;
  Hull hull = visualHull(dataset, resolution, settings.threads, cancellation, slack);
  if (!settings.accept_poor_data) {
    requireDirections(dataset, 0.5 * (hull.box.min + hull.box.max));
  }
  return hull;
}

}  // namespace nerf_pose_refiner
