// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "backend_floor.h"
#include "concurrency/parallel.h"
#include "dataset/dataset.h"
#include "evaluation/trial_observation.h"
#include "field/model_file.h"
#include "math/angle.h"
#include "refinement/field_refiner.h"
#include "tracking.h"
#include "trial_report.h"

// Trials of pose refinement: views of a dataset, each started from wrong poses. Prints a line a
// trial, with its work and its fraction of the machine's floor, and a summary.

namespace nerf_pose_refiner {
namespace {

struct Options {
  std::string model, dataset;
  std::string protocol = "paper", preset = "align";
  TrialObservation observation;
  int views = 5, starts = 5, first_view = 0;
  std::uint64_t seed = 1;
  double rotation_deg = 15, translation = -1;  // -1: the protocol's
  double search_deg = -1, search_translation = -1;
  double unit = 1;           // of the paper [model units]; 0: a fraction of the object
  int samples_per_step = 0;  // of the paper's mode; 0: the preset's
  int score_pixels = 0;      // likewise
  std::string loss;          ///< empty: the preset's
  bool json = false, trace = false, colours = false, first_pose = false, quiet = false;
  BackendChoice backend = {"cpu", 0, "auto", 0};
  TrackingBenchmark tracking;
};

double unitOf(const Options& options, double diameter) {
  return options.unit > 0 ? options.unit : diameter / kInversionUnitsPerDiameter;
}

Protocol protocolOf(const Options& options, double diameter) {
  Protocol protocol;
  const bool paper = options.protocol == "paper";
  const double length = paper ? unitOf(options, diameter) : diameter;
  protocol.start.about_object = !paper;
  protocol.start.rotation_rad = options.rotation_deg * kDegree;
  const double translation = options.translation >= 0 ? options.translation : (paper ? 0.25 : 0.15);
  protocol.start.translation = translation * length;
  protocol.search_rotation_rad =
      (options.search_deg >= 0 ? options.search_deg : options.rotation_deg) * kDegree;
  const double search = options.search_translation >= 0 ? options.search_translation
                        : paper                         ? 1.2 * translation
                                                        : translation;
  protocol.search_translation = search * length / diameter;
  // The paper's bound is in units of the NeRF Synthetic scenes; a robot's is the same fraction of
  // an object of 2.5 such units.
  protocol.of_camera = paper;
  protocol.offset_bound = (paper ? 0.05 : 0.02) * length;
  return protocol;
}

RefinerSettings settingsOf(const Options& options, double diameter) {
  RefinerSettings settings = RefinerSettings::named(options.preset);
  settings.compare_contrast = !options.colours;
  settings.seed = options.seed;
  settings.inversion.unit = unitOf(options, diameter);
  if (!options.loss.empty()) settings.inversion.descent.loss = lossFromName(options.loss);
  if (options.samples_per_step > 0) {
    settings.inversion.descent.samples_per_step = options.samples_per_step;
  }
  if (options.score_pixels > 0) settings.inversion.score_pixels = options.score_pixels;
  return settings;
}

/// Measured again for every view where the memory is the host's: it moves with the machine's load.
class MovingFloor {
 public:
  MovingFloor(BackendInfo backend, int threads, std::size_t table_bytes)
      : backend_(std::move(backend)), threads_(threads), table_bytes_(table_bytes) {}
  const Floor& now(bool quiet) {
    if (floor_.gathers_per_s == 0 || backend_.memory_bytes == 0) {
      floor_ = measureBackendFloor(backend_, threads_, table_bytes_);
      if (!quiet) printFloor(floor_, table_bytes_);
    }
    return floor_;
  }

 private:
  const BackendInfo backend_;
  int threads_;
  std::size_t table_bytes_;
  Floor floor_;
};

/// Runs trials of one model.
class TrialRunner {
 public:
  TrialRunner(const Options& options, std::shared_ptr<Backend> backend,
              std::shared_ptr<const LoadedField> field)
      : options_(options),
        backend_(std::move(backend)),
        field_(std::move(field)),
        protocol_(protocolOf(options, field_->field().metadata.diameter)),
        refiner_(backend_, settingsOf(options, field_->field().metadata.diameter)) {}

  const Protocol& protocol() const { return protocol_; }

  std::vector<Trial> run(const Dataset& dataset, MovingFloor* floor) {
    TrialObservation disturbance = options_.observation;
    disturbance.seed = options_.seed;
    const int available = static_cast<int>(dataset.views.size());
    const int views = std::min(options_.views, available);
    std::vector<Trial> trials;
    for (int v = 0; v < views; ++v) {
      const int index = (options_.first_view + v * available / views) % available;
      const PosedView& view = dataset.views[index];
      const Observation observation = disturbance.of(view, v);
      const Floor& best = floor->now(options_.json || options_.quiet);
      if (v == 0 && backend_->info().warms_up) runTrial(*field_, view, observation, 0);
      for (int s = 0; s < options_.starts; ++s) {
        Trial trial =
            runTrial(*field_, view, observation, static_cast<std::uint64_t>(v) * 1000 + s);
        trial.view = index;
        trial.start = s;
        trial.fraction = floorFraction(trial.refinement.work, trial.refinement.seconds, best);
        print(trial, view);
        trials.push_back(trial);
      }
    }
    return trials;
  }

  /// Seconds from a model file to a pose, in a process that is warm.
  double secondsToFirstPose(const PosedView& view) {
    const Observation observation = options_.observation.of(view, 0);
    const auto start = std::chrono::steady_clock::now();
    const auto field = backend_->load(std::make_shared<Field>(loadModel(options_.model)));
    runTrial(*field, view, observation, 0);
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  }

 private:
  Trial runTrial(const LoadedField& field, const PosedView& view, const Observation& observation,
                 std::uint64_t index) {
    const Eigen::Vector3d& centre = field.field().metadata.centre;
    Prior prior;
    prior.T_O_C = perturbedStart(view.T_O_C, protocol_.start, centre, options_.seed, index);
    prior.rotation_rad = protocol_.search_rotation_rad;
    prior.translation = protocol_.search_translation;
    prior.rotate_about_object = protocol_.start.about_object;
    Trial trial;
    trial.refinement = refiner_.refine(field, observation, prior);
    trial.before = poseError(prior.T_O_C, view.T_O_C, centre, view.camera);
    trial.after = poseError(trial.refinement.T_O_C, view.T_O_C, centre, view.camera);
    compareWithCovariance(view.T_O_C, centre, &trial);
    return trial;
  }

  void print(const Trial& trial, const PosedView& view) const {
    if (options_.quiet) return;
    if (options_.json) {
      std::printf("%s\n", toJson(trial).dump().c_str());
    } else {
      printTrial(trial, view, field_->field().metadata.centre, options_.trace);
    }
  }

  const Options& options_;
  const std::shared_ptr<Backend> backend_;
  const std::shared_ptr<const LoadedField> field_;
  const Protocol protocol_;
  FieldRefiner refiner_;
};

void run(const Options& options) {
  const double context_MiB = deviceMemory_MiB();
  const std::shared_ptr<Backend> backend = makeBackend(options.backend);
  const BackendInfo info = backend->info();
  const auto field = backend->load(std::make_shared<Field>(loadModel(options.model)));
  const FieldMetadata& object = field->field().metadata;
  const std::size_t table_bytes = field->field().grid.size() * sizeof(std::uint16_t);
  const int threads = threadCount(options.backend.threads);
  MovingFloor floor(info, threads, table_bytes);
  if (options.tracking.frames > 0) {
    TrackingBenchmark tracking = options.tracking;
    tracking.seed = options.seed;
    track(tracking, backend, *field, floor.now(options.quiet));
    return;
  }
  DatasetOptions reading;
  reading.threads = threads;
  const Dataset dataset = loadDataset(options.dataset, reading);
  TrialRunner runner(options, backend, field);
  const std::vector<Trial> trials = runner.run(dataset, &floor);
  nlohmann::json summary = summaryOf(trials, runner.protocol());
  if (info.memory_bytes > 0) {
    summary["device_context_mib"] = context_MiB;
    summary["device_memory_mib"] =
        deviceMemory_MiB() - context_MiB;  // the floor's, given back, too
  }
  if (options.first_pose) {
    summary["file_to_first_pose_s"] = runner.secondsToFirstPose(dataset.views.front());
  }
  summary["engine"] = info.description;
  summary["object"] = object.name;
  summary["peak_memory_mib"] = peakMemory_MiB();
  std::printf("%s\n", options.json ? summary.dump().c_str() : summary.dump(2).c_str());
}

void declareStarts(CLI::App* app, Options* options) {
  app->add_option("--protocol", options->protocol,
                  "paper: camera turned about itself and moved; robot: object turned about its "
                  "centre and moved")
      ->check(CLI::IsMember({"paper", "robot"}))
      ->capture_default_str();
  app->add_option("--views", options->views, "Number of views, evenly spread over the dataset")
      ->capture_default_str();
  app->add_option("--first-view", options->first_view)->capture_default_str();
  app->add_option("--starts", options->starts, "Starts of each view")->capture_default_str();
  app->add_option("--rotation-deg", options->rotation_deg, "Half width of the starts per axis")
      ->capture_default_str();
  app->add_option("--translation", options->translation,
                  "Half width of the starts per axis; paper: units (0.25), robot: diameters "
                  "(0.15)");
  app->add_option("--search-deg", options->search_deg,
                  "Half width of the search; default: that of the starts");
  app->add_option("--search-translation", options->search_translation,
                  "Half width of the search, in the unit of --translation");
}

void declareObservation(CLI::App* app, TrialObservation* observation) {
  app->add_option(
         "--background", observation->background,
         "white: known colour; alpha: known; mask: a photo, and a mask; own: the view's own "
         "surroundings, and its mask; photo: unknown")
      ->check(CLI::IsMember({"white", "alpha", "mask", "own", "photo"}))
      ->capture_default_str();
  app->add_option("--photos", observation->photos,
                  "Images, of which one is drawn to be put behind the object; none: drawn clutter");
  app->add_option("--light", observation->gain_bias, "Gain of the object per channel: 1 +- this");
  app->add_option("--occluder", observation->occluder,
                  "Square over this fraction of the object's box");
  app->add_option("--noise", observation->noise, "Standard deviation of added Gaussian noise");
}

void declareRefiner(CLI::App* app, Options* options) {
  app->add_option("--preset", options->preset, "Preset of the refiner")
      ->check(CLI::IsMember(RefinerSettings::presetNames()))
      ->capture_default_str();
  app->add_option("--seed", options->seed)->capture_default_str();
  app->add_option(
         "--unit", options->unit,
         "Length of one of the paper's units [model units]: 1 in the NeRF Synthetic scenes; "
         "0: the object spans 2.5 of them")
      ->capture_default_str();
  app->add_option("--score-pixels", options->score_pixels,
                  "The paper's mode: pixels that choose the winner; 0: the preset's");
  app->add_option("--samples-per-step", options->samples_per_step,
                  "The paper's mode: samples a step, of all hypotheses; 0: the preset's");
  app->add_option("--loss", options->loss,
                  "The paper's mode: one of the seven; default: the preset's");
  app->add_flag("--colours", options->colours,
                "Unknown background: compare colours, not contrasts (plain objects)");
}

void declareBackend(CLI::App* app, BackendChoice* backend) {
  app->add_option("--backend", backend->backend, "auto, cpu or cuda")
      ->check(CLI::IsMember({"auto", "cpu", "cuda"}))
      ->capture_default_str();
  app->add_option("--device", backend->device, "Number of the GPU")->capture_default_str();
  app->add_option("--threads", backend->threads, "0: all cores")->capture_default_str();
  app->add_option("--instruction-set", backend->instruction_set, "auto, baseline or avx2")
      ->capture_default_str();
}

void declareTracking(CLI::App* app, TrackingBenchmark* tracking) {
  app->add_option("--track", tracking->frames,
                  "Instead of trials: rendered frames through which the object is tracked");
  app->add_option("--frame-deg", tracking->frame_deg, "Rotation from frame to frame")
      ->capture_default_str();
  app->add_option("--frame-share", tracking->frame_fraction,
                  "Motion from frame to frame, in diameters")
      ->capture_default_str();
  app->add_flag("!--no-prediction", tracking->predict,
                "Look around the last pose, not where the last two point to");
  app->add_option("--frame-background", tracking->background,
                  "grey: known colour; clutter: unknown; mask: clutter, and a mask")
      ->check(CLI::IsMember({"grey", "clutter", "mask"}))
      ->capture_default_str();
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  using namespace nerf_pose_refiner;
  Options options;
  CLI::App app("Trials of pose refinement: views of a dataset, each started from wrong poses.");
  app.add_option("model", options.model, "Model file")->required();
  app.add_option("dataset", options.dataset, "transforms.json with the views to be refined")
      ->required();
  declareStarts(&app, &options);
  declareObservation(&app, &options.observation);
  declareRefiner(&app, &options);
  app.add_flag("--json", options.json, "One JSON object a line, the summary last");
  declareBackend(&app, &options.backend);
  declareTracking(&app, &options.tracking);
  app.add_flag("--first-pose", options.first_pose, "Also time from the model file to a pose");
  app.add_flag("--summary", options.quiet, "Only the summary");
  app.add_flag("--trace", options.trace, "Show every stage");
  CLI11_PARSE(app, argc, argv);
  try {
    run(options);
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "align_trials: %s\n", e.what());
    return 1;
  }
}
