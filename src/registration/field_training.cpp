// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/field_training.h"

#include <algorithm>
#include <stdexcept>

#include "registration/data_check.h"
#include "registration/equal_colours.h"
#include "registration/pose_correction.h"
#include "registration/trainer_setup.h"
#include "registration/training_run.h"
#include "registration/view_quality.h"
#include "registration/visual_hull.h"

namespace nerf_pose_refiner {
namespace {

// Rounds of a rough training and an alignment of the views with its model, and how far silhouettes
// may be out of place before each (@see visualHull) and after the last.
constexpr double kRoundSlack[] = {0.1, 0.03};

/// Every k-th view is held out, so that they are spread over the path.
SplitViews split(const std::vector<PosedView>& views, int held_out) {
  const int count = std::min(held_out, static_cast<int>(views.size()) / 10);
  const int interval = count > 0 ? static_cast<int>(views.size()) / count : 0;
  SplitViews parts;
  for (std::size_t i = 0; i < views.size(); ++i) {
    const bool keep_apart = count > 0 && static_cast<int>(parts.held_out.size()) < count &&
                            static_cast<int>(i) % interval == interval / 2;
    (keep_apart ? parts.held_out : parts.training).push_back(views[i]);
  }
  return parts;
}

Field finished(FieldTrainer* trainer, const Dataset& dataset,
               const CancellationToken& cancellation) {
  Field field = trainer->finish(cancellation);
  if (field.metadata.diameter > 0) return field;
  throw std::runtime_error(dataset.folder + ": training found nothing opaque");
}

/// One training, and its quality.
TrainedField train(Backend* backend, const Dataset& dataset, const RegistrationOptions& settings,
                   const std::function<void(const RegistrationProgress&)>& progress,
                   const CancellationToken& cancellation) {
  Hull hull = hullOf(dataset, settings, settings.refine_poses ? kSlackAfter : 0, cancellation);
  TrainedField result;
  result.views = split(dataset.views, settings.held_out);
  std::vector<PosedView>& held_out = result.views.held_out;
  held_out.erase(std::remove_if(held_out.begin(), held_out.end(),
                                [&](const PosedView& view) { return !isTelling(view, hull.box); }),
                 held_out.end());
  const auto trainer =
      trainerOf(backend, result.views.training, {dataset.has_alpha}, settings, std::move(hull));
  TrainingRun run(backend, trainer.get(), settings, result.views, progress);
  run.run("training", cancellation);
  run.report("occupancy");
  result.field = finished(trainer.get(), dataset, cancellation);
  run.report("quality");
  measureQuality(backend, held_out, cancellation, &result.field);
  return result;
}

/// The dataset with poses that agree with each other (@see alignViews).
Dataset withCorrectedPoses(Backend* backend, const Dataset& dataset,
                           const RegistrationOptions& settings,
                           const std::function<void(const RegistrationProgress&)>& progress,
                           const CancellationToken& cancellation) {
  RegistrationOptions rough = settings;
  rough.steps = std::max(1, settings.steps / kRoughFraction);
  rough.max_seconds = settings.max_seconds / kRoughFraction;
  rough.target_psnr_db = 0;
  std::vector<Pose> measured;
  for (const PosedView& view : dataset.views) measured.push_back(view.T_O_C);
  Dataset corrected = dataset;
  for (const double slack : kRoundSlack) {
    const auto trainer = trainerOf(backend, corrected.views, {dataset.has_alpha}, rough,
                                   hullOf(corrected, rough, slack, cancellation));
    const SplitViews views = {corrected.views, {}};
    TrainingRun run(backend, trainer.get(), rough, views, progress);
    run.run("rough training", cancellation);
    run.report("poses");
    const auto field =
        backend->load(std::make_shared<Field>(finished(trainer.get(), dataset, cancellation)));
    const std::vector<Pose> poses = inMeasuredFrame(
        alignViews(*field, corrected.views, measured, dataset.has_alpha, cancellation), measured);
    for (std::size_t i = 0; i < poses.size(); ++i) corrected.views[i].T_O_C = poses[i];
  }
  return corrected;
}

}  // namespace

TrainedField trainField(Backend* backend, const Dataset& dataset,
                        const RegistrationOptions& settings,
                        const std::function<void(const RegistrationProgress&)>& progress,
                        const CancellationToken& cancellation) {
  Dataset corrected = dataset;
  RegistrationOptions rest = settings;
  if (settings.refine_poses) {
    corrected = withCorrectedPoses(backend, dataset, settings, progress, cancellation);
    rest.max_seconds = 0.5 * settings.max_seconds;
  }
  const EqualColours equal = withEqualColours(backend, corrected, rest, progress, cancellation);
  // At most a quarter, but for the visual hull.
  rest.max_seconds = std::max(0.5 * rest.max_seconds, rest.max_seconds - equal.seconds);
  TrainedField result = train(backend, equal.dataset, rest, progress, cancellation);
  result.field.metadata.exposure_spread = equal.spread;
  return result;
}

}  // namespace nerf_pose_refiner
