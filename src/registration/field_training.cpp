// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/field_training.h"

#include <algorithm>
#include <stdexcept>

#include "registration/data_check.h"
#include "registration/photo_gains.h"
#include "registration/pose_correction.h"
#include "registration/training_run.h"
#include "registration/view_quality.h"
#include "registration/visual_hull.h"

namespace nerf_pose_refiner {
namespace {

// Rounds of a rough training and an alignment of the views with its model, and how far silhouettes
// may be out of place before each (@see visualHull) and after the last.
constexpr double kRoundSlack[] = {0.1, 0.03};
constexpr double kSlackAfter = 0.015;
constexpr int kRoughFraction = 4;  // a rough training has so much fewer steps, and time

// Photos of different exposure are compared with a model that knows no directions: with them it
// could show each photo in its own colours. kGainSpread is above what such models of photos of one
// exposure give; rounds end when what is left is small.
constexpr int kMattFraction = 16;         // of steps and time
constexpr int kMattSamples = 1 << 21;     // at least, where that is no more than a rough training
constexpr int kMaxMattSamples = 1 << 24;  // more show exposures no better
constexpr double kMinMattSamples = 1e6;   // models of fewer samples say nothing of photos
constexpr double kGainSpread = 0.04, kGainSettled = 0.01;
constexpr int kGainRounds = 3;

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

struct TrainerKind {
  bool has_alpha;        ///< of the views
  bool is_matt = false;  ///< colours do not depend on the direction
};

/// Before backgrounds that change only what is opaque looks right: objects where their photos say
/// so, and scenes everywhere. (An object in a box may end before the background that is seen in the
/// box, too.)
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

/// A dataset of views of one exposure.
struct EqualColours {
  Dataset dataset;
  double spread = 0;  ///< of the exposures before (@see gainSpread); 0: they are left as they are
};

/// Makes the views' exposures equal, if they differ (@see photoGains).
EqualColours withEqualColours(Backend* backend, const Dataset& dataset,
                              const RegistrationOptions& settings,
                              const std::function<void(const RegistrationProgress&)>& progress,
                              const CancellationToken& cancellation) {
  EqualColours equal = {dataset};
  RegistrationOptions rough = settings;
  rough.steps = std::clamp(kMattSamples / settings.samples_per_step, settings.steps / kMattFraction,
                           settings.steps / kRoughFraction);
  rough.steps = std::min(rough.steps, kMaxMattSamples / settings.samples_per_step);
  rough.max_seconds = settings.max_seconds / kMattFraction;
  rough.target_psnr_db = 0;
  if (settings.keep_colours) return equal;
  const int least = static_cast<int>(kMinMattSamples / rough.samples_per_step);
  if (rough.steps <= least) return equal;
  const Hull hull =
      hullOf(dataset, settings, settings.refine_poses ? kSlackAfter : 0, cancellation);
  std::vector<PhotoGain> total(dataset.views.size());
  for (int round = 0; round < kGainRounds; ++round) {
    const auto trainer =
        trainerOf(backend, equal.dataset.views, {dataset.has_alpha, true}, rough, hull);
    const SplitViews views = {equal.dataset.views, {}};
    TrainingRun run(backend, trainer.get(), rough, views, progress);
    run.run("rough training", cancellation);
    if (trainer->stepsDone() <= least) break;  // the time was too short
    run.report("exposure");
    const auto model = std::make_shared<Field>(trainer->finish(cancellation));
    if (!(model->metadata.diameter > 0)) break;  // nothing is opaque yet
    const auto field = backend->load(model);
    const std::vector<PhotoGain> gains = photoGains(*field, equal.dataset.views, cancellation);
    if (gainSpread(gains) < (round == 0 ? kGainSpread : kGainSettled)) break;
    for (std::size_t i = 0; i < total.size(); ++i) total[i] = combined(total[i], gains[i]);
    equal.spread = gainSpread(total);
    equal.dataset.views = withGains(dataset.views, total);
  }
  return equal;
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
  if (!settings.keep_colours) rest.max_seconds *= 1 - 1.0 / kMattFraction;
  TrainedField result = train(backend, equal.dataset, rest, progress, cancellation);
  result.field.metadata.exposure_spread = equal.spread;
  return result;
}

}  // namespace nerf_pose_refiner
