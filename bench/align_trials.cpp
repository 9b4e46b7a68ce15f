// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "nerf_pose_refiner/dataset/dataset.h"
#include "nerf_pose_refiner/evaluate/pose_error.h"
#include "nerf_pose_refiner/evaluate/start.h"
#include "nerf_pose_refiner/field/model_file.h"
#include "nerf_pose_refiner/refine/refiner.h"
#include "nerf_pose_refiner/tasks/parallel.h"
#include "trial_observation.h"
#include "work_report.h"

// Trials of pose refinement: views of a dataset, each started from wrong poses. Prints a line a
// trial, with its work and its share of the machine's floor, and a summary.

namespace nerf_pose_refiner {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

struct Options {
  std::string model, dataset;
  std::string protocol = "paper", preset = "align";
  TrialObservation observation;
  int views = 5, starts = 5, first_view = 0, threads = 0;
  std::uint64_t seed = 1;
  std::string instruction_set = "auto";
  double rotation_deg = 15, translation = -1;  // -1: the protocol's
  double search_deg = -1, search_translation = -1;
  double unit = 1;           // of the paper [model units]; 0: a share of the object
  int samples_per_step = 0;  // of the paper's mode; 0: the preset's
  std::string loss = lossName(DescentPlan().loss);
  bool json = false, trace = false, colours = false;
};

struct Trial {
  int view = 0, start = 0;
  PoseError before, after;
  Refinement refinement;
  FloorShare share;
};

// The pose errors that a protocol starts from, how wide it searches, and what it accepts.
struct Protocol {
  StartSpread start;
  double search_rotation_rad, search_translation;  // the latter in diameters
  bool of_camera;                                  // the offset that counts: else the object's
  double offset_bound;                             // [model units]
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
  // The paper's bound is in units of the NeRF Synthetic scenes; a robot's is the same share of an
  // object of 2.5 such units.
  protocol.of_camera = paper;
  protocol.offset_bound = (paper ? 0.05 : 0.02) * length;
  return protocol;
}

nlohmann::json toJson(const Trial& trial) {
  const Refinement& r = trial.refinement;
  return {{"view", trial.view},
          {"start", trial.start},
          {"start_deg", trial.before.rotation_rad / kDegree},
          {"start_camera_offset", trial.before.camera_offset},
          {"start_object_offset", trial.before.object_offset},
          {"deg", trial.after.rotation_rad / kDegree},
          {"camera_offset", trial.after.camera_offset},
          {"object_offset", trial.after.object_offset},
          {"pixels", trial.after.pixels},
          {"outcome", static_cast<int>(r.outcome)},
          {"score", r.score},
          {"visible_fraction", r.visible_fraction},
          {"seconds", r.seconds},
          {"samples", r.work.samples},
          {"gathers", r.work.gathers},
          {"flops", r.work.flops},
          {"share_of_floor", trial.share.of_larger}};
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  const std::size_t n = values.size();
  return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

template <typename Value>
double medianOf(const std::vector<Trial>& trials, const Value& value) {
  std::vector<double> values;
  for (const Trial& trial : trials) values.push_back(value(trial));
  return median(values);
}

template <typename Test>
double shareOf(const std::vector<Trial>& trials, const Test& test) {
  return static_cast<double>(std::count_if(trials.begin(), trials.end(), test)) /
         static_cast<double>(trials.size());
}

nlohmann::json summaryOf(const std::vector<Trial>& trials, const Protocol& protocol) {
  const double far = protocol.offset_bound;
  const auto turned = [](const Trial& t) { return t.after.rotation_rad / kDegree; };
  const auto moved = [&](const Trial& t) {
    return protocol.of_camera ? t.after.camera_offset : t.after.object_offset;
  };
  return {
      {"trials", trials.size()},
      {"share_under_5_deg", shareOf(trials, [&](const Trial& t) { return turned(t) < 5; })},
      {"share_under_offset", shareOf(trials, [&](const Trial& t) { return moved(t) < far; })},
      {"offset_bound", far},
      {"share_jointly",
       shareOf(trials, [&](const Trial& t) { return turned(t) < 5 && moved(t) < far; })},
      {"share_1_deg_fifth_of_offset",
       shareOf(trials, [&](const Trial& t) { return turned(t) < 1 && moved(t) < far / 5; })},
      {"median_deg", medianOf(trials, turned)},
      {"median_offset", medianOf(trials, moved)},
      {"median_pixels", medianOf(trials, [](const Trial& t) { return t.after.pixels; })},
      {"median_seconds", medianOf(trials, [](const Trial& t) { return t.refinement.seconds; })},
      {"median_samples",
       medianOf(trials, [](const Trial& t) { return double(t.refinement.work.samples); })},
      {"median_gathers",
       medianOf(trials, [](const Trial& t) { return t.refinement.work.gathers; })},
      {"median_flops", medianOf(trials, [](const Trial& t) { return t.refinement.work.flops; })},
      {"median_share_of_floor", medianOf(trials, [](const Trial& t) { return t.share.of_larger; })},
      {"median_share_of_floor_without_overlap",
       medianOf(trials, [](const Trial& t) { return t.share.of_sum; })}};
}

void print(const Options& options, const Trial& trial, const PosedView& view,
           const Eigen::Vector3d& centre) {
  if (options.json) {
    std::printf("%s\n", toJson(trial).dump().c_str());
    return;
  }
  const Refinement& r = trial.refinement;
  std::printf(
      "view %2d start %d: %5.1f deg %.3f u -> %6.2f deg %.4f u (object %.4f u, %.2f px)  "
      "score %.2f  %5.2f s  %5.1f M samples, %.2f G gathers, %.1f GFLOP, %.2f of the floor\n",
      trial.view, trial.start, trial.before.rotation_rad / kDegree, trial.before.camera_offset,
      trial.after.rotation_rad / kDegree, trial.after.camera_offset, trial.after.object_offset,
      trial.after.pixels, r.score, r.seconds, static_cast<double>(r.work.samples) / 1e6,
      1e-9 * r.work.gathers, 1e-9 * r.work.flops, trial.share.of_larger);
  if (options.trace) {
    for (const TraceEntry& t : r.trace) {
      const PoseError e = poseError(t.best_T_O_C, view.T_O_C, centre, view.camera);
      std::printf(
          "    %-8s %2d live, loss %9.6f: %6.2f deg, object %.4f u; %.2f s, %.1f M samples\n",
          t.stage.c_str(), t.live, t.best_loss, e.rotation_rad / kDegree, e.object_offset,
          t.seconds, static_cast<double>(t.work.samples) / 1e6);
    }
  }
  std::fflush(stdout);
}

RefinerSettings settingsOf(const Options& options, double diameter) {
  RefinerSettings settings = RefinerSettings::named(options.preset);
  settings.compare_contrast = !options.colours;
  settings.seed = options.seed;
  settings.inversion.unit = unitOf(options, diameter);
  settings.inversion.descent.loss = lossFromName(options.loss);
  if (options.samples_per_step > 0) {
    settings.inversion.descent.samples_per_step = options.samples_per_step;
  }
  return settings;
}

Trial runTrial(const Options& options, const Protocol& protocol, Refiner* refiner,
               const LoadedField& field, const PosedView& view, const Observation& observation,
               std::uint64_t index) {
  const Eigen::Vector3d& centre = field.field().metadata.centre;
  Prior prior;
  prior.T_O_C = perturbedStart(view.T_O_C, protocol.start, centre, options.seed, index);
  prior.rotation_rad = protocol.search_rotation_rad;
  prior.translation = protocol.search_translation;
  prior.rotate_about_object = protocol.start.about_object;
  Trial trial;
  trial.refinement = refiner->refine(field, observation, prior);
  trial.before = poseError(prior.T_O_C, view.T_O_C, centre, view.camera);
  trial.after = poseError(trial.refinement.T_O_C, view.T_O_C, centre, view.camera);
  return trial;
}

void run(const Options& options) {
  const std::shared_ptr<Engine> engine = makeCpuEngine(options.threads, options.instruction_set);
  const auto field = engine->load(std::make_shared<Field>(loadModel(options.model)));
  const FieldMetadata& object = field->field().metadata;
  const std::size_t table_bytes = field->field().grid.size() * sizeof(std::uint16_t);
  const int threads = threadCount(options.threads);
  DatasetOptions reading;
  reading.threads = threads;
  const Dataset dataset = loadTransforms(options.dataset, reading);
  TrialObservation disturbance = options.observation;
  disturbance.seed = options.seed;
  Refiner refiner(engine, settingsOf(options, object.diameter));
  const Protocol protocol = protocolOf(options, object.diameter);

  const int available = static_cast<int>(dataset.views.size());
  const int views = std::min(options.views, available);
  std::vector<Trial> trials;
  for (int v = 0; v < views; ++v) {
    const int index = (options.first_view + v * available / views) % available;
    const PosedView& view = dataset.views[index];
    const Observation observation = disturbance.of(view, v);
    const Floor floor = measureFloor(threads, table_bytes);  // it moves with the machine's load
    if (!options.json) printFloor(floor, table_bytes);
    for (int s = 0; s < options.starts; ++s) {
      Trial trial = runTrial(options, protocol, &refiner, *field, view, observation,
                             static_cast<std::uint64_t>(v) * 1000 + s);
      trial.view = index;
      trial.start = s;
      trial.share = floorShare(trial.refinement.work, trial.refinement.seconds, floor);
      print(options, trial, view, object.centre);
      trials.push_back(trial);
    }
  }
  nlohmann::json summary = summaryOf(trials, protocol);
  summary["engine"] = engine->describe();
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
  app->add_option("--views", options->views, "Evenly spread over the dataset")
      ->capture_default_str();
  app->add_option("--first-view", options->first_view)->capture_default_str();
  app->add_option("--starts", options->starts, "Starts of each view")->capture_default_str();
  app->add_option("--rotation-deg", options->rotation_deg, "Of the starts, half width per axis")
      ->capture_default_str();
  app->add_option("--translation", options->translation,
                  "Of the starts, half width per axis; paper: units (0.25), robot: diameters "
                  "(0.15)");
  app->add_option("--search-deg", options->search_deg,
                  "Half width of the search; default: starts'");
  app->add_option("--search-translation", options->search_translation,
                  "Half width of the search, in the unit of --translation");
}

void declareObservation(CLI::App* app, TrialObservation* observation) {
  app->add_option("--background", observation->background,
                  "white: known colour; alpha: known; mask: a photo, and a mask; photo: unknown")
      ->check(CLI::IsMember({"white", "alpha", "mask", "photo"}))
      ->capture_default_str();
  app->add_option("--photos", observation->photos, "Pictures to put behind the object, in turn");
  app->add_option("--light", observation->light, "Gain of the object per channel: 1 +- this");
  app->add_option("--occluder", observation->occluder,
                  "Square over this share of the object's box");
  app->add_option("--noise", observation->noise, "Standard deviation of added Gaussian noise");
}

void declareRefiner(CLI::App* app, Options* options) {
  app->add_option("--preset", options->preset, "Of the refiner")
      ->check(CLI::IsMember(RefinerSettings::presetNames()))
      ->capture_default_str();
  app->add_option("--seed", options->seed)->capture_default_str();
  app->add_option("--threads", options->threads, "0: all cores")->capture_default_str();
  app->add_option("--instruction-set", options->instruction_set, "auto, baseline or avx2")
      ->capture_default_str();
  app->add_option(
         "--unit", options->unit,
         "Length of one of the paper's units [model units]: 1 in the NeRF Synthetic scenes; "
         "0: the object spans 2.5 of them")
      ->capture_default_str();
  app->add_option("--samples-per-step", options->samples_per_step,
                  "The paper's mode: samples a step, of all hypotheses; 0: the preset's");
  app->add_option("--loss", options->loss, "The paper's mode: one of the seven")
      ->capture_default_str();
  app->add_flag("--colours", options->colours,
                "Unknown background: compare colours, not contrasts (plain objects)");
}

void check(const Options& options) {
  const std::string& background = options.observation.background;
  if ((background == "photo" || background == "mask") && options.observation.photos.empty()) {
    throw std::invalid_argument("--background " + background + " needs --photos");
  }
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
  app.add_flag("--trace", options.trace, "Show every stage");
  CLI11_PARSE(app, argc, argv);
  try {
    check(options);
    run(options);
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "align_trials: %s\n", e.what());
    return 1;
  }
}
