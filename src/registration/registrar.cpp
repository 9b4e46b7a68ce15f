// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/registrar.h"

#include <algorithm>
#include <cmath>
#include <sstream>
#include <stdexcept>

#include "image/colour.h"
#include "registration/data_check.h"
#include "registration/photo_gains.h"
#include "registration/pose_correction.h"
#include "registration/registration_hash.h"
#include "registration/training_run.h"
#include "registration/visual_hull.h"
#include "trust/look_alikes.h"
#include "trust/pose_statistics.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kMaxPsnr_db = 100;  // of two images that are equal

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

/// Views whose poses are found again, to learn how well that goes: those held out, and some that
/// were learned, for few are held out.
std::vector<PosedView> poseViews(const SplitViews& split) {
  constexpr std::size_t kViews = 12;
  const std::vector<PosedView>& training = split.training;
  std::vector<PosedView> views = split.held_out;
  const std::size_t missing = std::min(kViews - std::min(kViews, views.size()), training.size());
  for (std::size_t i = 0; i < missing; ++i)
    views.push_back(training[training.size() * i / missing]);
  return views;
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

/// Where a view says what there is. One with transparency does so everywhere; one without shows
/// whatever lies behind the box as well, and counts only where the box can be seen.
std::vector<std::uint8_t> tellingPixels(const PosedView& view, const Box& box) {
  const std::vector<std::uint8_t>& rgba = view.rgba->values;
  std::vector<std::uint8_t> telling(view.rgba->pixels(), 1);
  for (std::size_t i = 3; i < rgba.size(); i += 4) {
    if (rgba[i] < 255) return telling;
  }
  for (int y = 0; y < view.camera.height; ++y) {
    for (int x = 0; x < view.camera.width; ++x) {
      const Eigen::Vector3d direction_O = view.T_O_C.R * view.camera.direction(x, y);
      telling[static_cast<std::size_t>(y) * view.camera.width + x] =
          box.meets(view.T_O_C.t, direction_O);
    }
  }
  return telling;
}

/// Error of a rendering on black against a view.
struct ViewError {
  double psnr_db;     ///< at most kMaxPsnr_db
  double inside_rms;  ///< where the view shows the object
};

ViewError viewError(const LoadedField& field, const PosedView& view,
                    const CancellationToken& cancellation) {
  const PremultipliedImage truth = premultiply(*view.rgba);
  const std::vector<std::uint8_t> telling = tellingPixels(view, field.field().box);
  const Rendering rendering =
      field.render({view.camera, view.T_O_C}, RenderOptions(), cancellation);
  double squares = 0, inside_squares = 0;
  std::size_t pixels = 0, inside = 0;
  for (std::size_t i = 0; i < telling.size(); ++i) {
    if (!telling[i]) continue;
    double pixel_squares = 0;
    for (int c = 0; c < 3; ++c) {
      const double error = rendering.colour.values[3 * i + c] - truth.colour.values[3 * i + c];
      pixel_squares += error * error;
    }
    squares += pixel_squares;
    ++pixels;
    if (truth.alpha.values[i] < 0.5f) continue;
    inside_squares += pixel_squares;
    ++inside;
  }
  const auto mean = [](double sum, std::size_t n) {
    return n > 0 ? sum / (3.0 * static_cast<double>(n)) : 0;
  };
  return {std::min(kMaxPsnr_db, -10 * std::log10(mean(squares, pixels))),
          std::sqrt(mean(inside_squares, inside))};
}

/// Whether a view shows how good a model is: it shows the object, or the box that holds it.
bool isTelling(const PosedView& view, const Box& box) {
  const std::vector<std::uint8_t> telling = tellingPixels(view, box);
  for (std::size_t i = 0; i < telling.size(); ++i) {
    if (telling[i] && view.rgba->values[4 * i + 3] > 0) return true;
  }
  return false;
}

/// How well held-out views are shown at their true poses.
void measureQuality(Backend* backend, const std::vector<PosedView>& held_out,
                    const CancellationToken& cancellation, Field* field) {
  if (held_out.empty()) return;
  const auto loaded = backend->load(std::make_shared<Field>(*field));
  double psnr_sum = 0, sum = 0, squares = 0;
  for (const PosedView& view : held_out) {
    const ViewError error = viewError(*loaded, view, cancellation);
    psnr_sum += error.psnr_db;
    sum += error.inside_rms;
    squares += error.inside_rms * error.inside_rms;
  }
  const double n = static_cast<double>(held_out.size());
  field->metadata.psnr_db = psnr_sum / n;
  field->metadata.score.views = static_cast<int>(held_out.size());
  field->metadata.score.mean_loss = sum / n;
  field->metadata.score.stddev_loss = std::sqrt(std::max(0.0, squares / n - sum * sum / (n * n)));
}

void requireBox(const Dataset& dataset) {
  if (!dataset.has_box) return;
  const Eigen::Vector3d &low = dataset.box_min, &high = dataset.box_max;
  if (low.allFinite() && high.allFinite() && (low.array() < high.array()).all()) return;
  std::ostringstream text;
  text << "the box from " << low.transpose() << " to " << high.transpose() << " is empty";
  throw std::invalid_argument(text.str());
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
Field train(Backend* backend, const Dataset& dataset, const RegistrationOptions& settings,
            const std::function<void(const RegistrationProgress&)>& progress,
            const CancellationToken& cancellation) {
  Hull hull = hullOf(dataset, settings, settings.refine_poses ? kSlackAfter : 0, cancellation);
  SplitViews views = split(dataset.views, settings.held_out);
  std::vector<PosedView>& held_out = views.held_out;
  held_out.erase(std::remove_if(held_out.begin(), held_out.end(),
                                [&](const PosedView& view) { return !isTelling(view, hull.box); }),
                 held_out.end());
  const auto trainer =
      trainerOf(backend, views.training, {dataset.has_alpha}, settings, std::move(hull));
  TrainingRun run(backend, trainer.get(), settings, views, progress);
  run.run("training", cancellation);
  run.report("occupancy");
  Field field = finished(trainer.get(), dataset, cancellation);
  run.report("quality");
  measureQuality(backend, held_out, cancellation, &field);
  run.report("pose quality");
  field.metadata.symmetries = settings.symmetries;
  field.metadata.look_alikes =
      measureLookAlikes(backend, *backend->load(std::make_shared<Field>(field)), cancellation);
  const auto loaded = backend->load(std::make_shared<Field>(field));
  const std::vector<PosedView> searched = poseViews(views);
  field.metadata.pose = measurePoses(backend, *loaded, searched, cancellation);
  if (!settings.accept_poor_data) {
    requireUsableModel(field.metadata, static_cast<int>(searched.size()));
  }
  return field;
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

Field learnField(Backend* backend, const Dataset& dataset, const RegistrationOptions& settings,
                 const std::function<void(const RegistrationProgress&)>& progress,
                 const CancellationToken& cancellation) {
  settings.validate();
  requireBox(dataset);
  if (!settings.accept_poor_data) requireDifferentViews(dataset);
  Dataset corrected = dataset;
  RegistrationOptions rest = settings;
  if (settings.refine_poses) {
    corrected = withCorrectedPoses(backend, dataset, settings, progress, cancellation);
    rest.max_seconds = 0.5 * settings.max_seconds;
  }
  const EqualColours equal = withEqualColours(backend, corrected, rest, progress, cancellation);
  if (!settings.keep_colours) rest.max_seconds *= 1 - 1.0 / kMattFraction;
  Field field = train(backend, equal.dataset, rest, progress, cancellation);
  field.metadata.exposure_spread = equal.spread;
  field.metadata.metres_per_unit =
      settings.metres_per_unit > 0 ? settings.metres_per_unit : dataset.metres_per_unit;
  field.metadata.data_hash = registrationHash(dataset, settings, cancellation);
  return field;
}

double meanPsnr(const LoadedField& field, const std::vector<PosedView>& views,
                const CancellationToken& cancellation) {
  if (views.empty()) throw std::invalid_argument("PSNR of no views");
  double sum = 0;
  for (const PosedView& view : views) sum += viewError(field, view, cancellation).psnr_db;
  return sum / static_cast<double>(views.size());
}

}  // namespace nerf_pose_refiner
