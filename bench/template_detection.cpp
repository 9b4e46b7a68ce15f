// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Looks for an object in whole images with templates, without a hint: how far down the list of
// candidates the first right one is, and how long that takes.

#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <memory>
#include <string>
#include <vector>

#include "backend/common/observed_colours.h"
#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "concurrency/seconds_since.h"
#include "dataset/dataset.h"
#include "detection/template_search.h"
#include "detection/template_view.h"
#include "evaluation/disturbance.h"
#include "evaluation/pose_error.h"
#include "evaluation/statistics.h"
#include "evaluation/trial_observation.h"
#include "field/object_metadata.h"
#include "image/colour.h"
#include "image/io.h"
#include "math/angle.h"
#include "recorded_sequence.h"
#include "refinement/keyframe_refiner.h"

namespace nerf_pose_refiner {
namespace {

struct Options {
  std::string model, data;
  TrialObservation observation;
  BackendChoice backend = {"cpu", 0, "auto", 0};
  int every = 1, first = 0;
  int aligned = 0;                       // candidates that are aligned; 0: that is not measured
  double largest = 1, smallest = 0.125;  // width of the object, of the image's
  TemplateBankSettings bank;
  TemplateSearchSettings search;
};

/// An image and where its camera was.
struct Scene {
  std::size_t number;  // in its data
  Observation observation;
  Pose T_O_C;
};

class Benchmark {
 public:
  explicit Benchmark(const Options& options)
      : options_(options),
        backend_(makeBackend(options.backend)),
        field_(backend_->load(std::make_shared<const Field>(loadField(options.model)))),
        object_(field_->field().metadata) {}

  void run() {
    const auto begin = std::chrono::steady_clock::now();
    const auto bank =
        std::make_shared<const TemplateBank>(makeTemplateBank(*field_, options_.bank, {}));
    std::printf("%zu views in %.1f s, %.2f MiB\n", bank->views.size(), secondsSince(begin),
                static_cast<double>(bank->memory_bytes()) / (1 << 20));
    TemplateSearch search(backend_.get(), bank, object_, options_.search);
    const bool is_dataset = options_.data.find(".json") != std::string::npos;
    if (is_dataset) {
      const Dataset dataset = loadDataset(options_.data);
      for (std::size_t i = options_.first; i < dataset.views.size(); i += options_.every) {
        const PosedView& view = dataset.views[i];
        look(&search, {i, options_.observation.of(view, i), view.T_O_C});
      }
    } else {
      const RecordedSequence sequence = readSequence(options_.data);
      for (std::size_t i = options_.first; i < sequence.frames.size(); i += options_.every) {
        look(&search, recorded(sequence, i));
      }
    }
    report();
  }

 private:
  Scene recorded(const RecordedSequence& sequence, std::size_t i) const {
    const double unit_m = object_.metres_per_unit > 0 ? object_.metres_per_unit : 1;
    const Pose& T_C_O = sequence.frames[i].T_C_O;
    Scene trial;
    trial.number = i;
    trial.observation.image = toFloat(readImage(sequence.frames[i].file));
    trial.observation.camera = sequence.camera;
    trial.T_O_C = Pose(T_C_O.R, T_C_O.t / unit_m).inverse();
    disturb(&trial);
    return trial;
  }

  /// What trials of a dataset meet, in an image that has its background already.
  void disturb(Scene* trial) const {
    const TrialObservation& how = options_.observation;
    const DisturbanceDraw draw = {how.seed, trial->number};
    Image& image = trial->observation.image;
    if (how.gain_bias > 0) {
      PremultipliedImage all = {image, Image(image.width, image.height, 1, 1.0f)};
      applyGainBias(how.gain_bias, draw, &all);
      image = all.colour;
    }
    if (how.occluder > 0) {
      const Rendering seen = field_->render({trial->observation.camera, trial->T_O_C}, {}, {});
      occlude(how.occluder, draw, seen.alpha, &image);
    }
    if (how.noise > 0) addGaussianNoise(how.noise, draw, &image);
  }

  void look(TemplateSearch* search, const Scene& trial) {
    const Camera& camera = trial.observation.camera;
    const double whole = camera.fx / camera.width;
    const DistanceRange range = {std::max(0.8, whole / options_.largest),
                                 whole / options_.smallest};
    const auto begin = std::chrono::steady_clock::now();
    const TemplateFindings found =
        search->find(observedColours(trial.observation), camera, range, {});
    seconds_.push_back(secondsSince(begin));
    ranks_.push_back(rankOf(found.candidates, trial));
    const double distance = (trial.T_O_C.t - object_.centre).norm() / object_.diameter;
    std::printf(
        "%4zu: width %.2f, rank %4d of %zu, evidence %.3f; %.2f s (scan %.2f, fit %.2f), "
        "%.2g look-ups",
        trial.number, whole / distance, ranks_.back(), found.candidates.size(),
        found.candidates.empty() ? 0 : found.candidates.front().evidence, seconds_.back(),
        found.scan_s, found.fit_s, static_cast<double>(found.lookups));
    if (options_.aligned > 0) align(found.candidates, trial);
    std::printf("\n");
    std::fflush(stdout);
  }

  /// Aligns the first candidates and takes the best score.
  void align(const PoseCandidates& candidates, const Scene& trial) {
    const auto begin = std::chrono::steady_clock::now();
    KeyframeRefiner refiner(backend_.get(), field_, KeyframeSearchSettings());
    Refinement best;
    best.score = -1;
    const std::size_t count = std::min<std::size_t>(options_.aligned, candidates.size());
    for (std::size_t i = 0; i < count; ++i) {
      Prior prior;
      prior.T_O_C = candidates[i].T_O_C;
      const Refinement refined = refiner.follow({trial.observation, 0}, prior);
      if (refined.outcome == Outcome::kRefined && refined.score > best.score) best = refined;
    }
    const PoseError error = errorOf(best.T_O_C, trial);
    const double degrees = error.rotation_rad / kDegree;
    const double offset = error.object_offset / object_.diameter;
    const bool is_right = best.score >= 0 && degrees < 5 && offset < 0.05;
    right_ += is_right;
    std::printf("; aligned in %.2f s: score %.2f, %.2f deg, %.1f %% %s", secondsSince(begin),
                best.score, degrees, 100 * offset, is_right ? "" : "WRONG");
  }

  PoseError errorOf(const Pose& T_O_C, const Scene& trial) const {
    return poseError(T_O_C, trial.T_O_C, object_.centre, trial.observation.camera,
                     object_.symmetries);
  }

  /// Of the first candidate that is nearly right; -1: there is none. Far away a fraction of the
  /// distance counts: alignment follows the size in the image.
  int rankOf(const PoseCandidates& found, const Scene& trial) const {
    const double distance = (trial.T_O_C.t - object_.centre).norm();
    const double near = std::max(0.2 * object_.diameter, 0.1 * distance);
    for (std::size_t i = 0; i < found.size(); ++i) {
      const PoseError error = errorOf(found[i].T_O_C, trial);
      if (error.rotation_rad < 16 * kDegree && error.object_offset < near) {
        return static_cast<int>(i);
      }
    }
    return -1;
  }

  void report() const {
    std::printf("%zu images; right within the first", ranks_.size());
    for (const int limit : {1, 10, 50, 200}) {
      const auto within = std::count_if(ranks_.begin(), ranks_.end(),
                                        [&](int rank) { return rank >= 0 && rank < limit; });
      std::printf(" %d: %td", limit, within);
    }
    if (options_.aligned > 0) std::printf("; aligned %d", right_);
    std::printf("; median %.2f s\n", percentile(seconds_, 0.5));
  }

  Options options_;
  std::unique_ptr<Backend> backend_;
  std::shared_ptr<const LoadedField> field_;
  const FieldMetadata& object_;
  std::vector<int> ranks_;
  std::vector<double> seconds_;
  int right_ = 0;
};

void addOptions(CLI::App* app, Options* o) {
  app->add_option("model", o->model, "the object's .safetensors")->required();
  app->add_option("data", o->data,
                  "a dataset's transforms.json, or the folder of a recording's sequence.json")
      ->required();
  app->add_option("--photos", o->observation.photos,
                  "one is drawn, to be put behind a view; none: drawn clutter");
  app->add_option("--light", o->observation.gain_bias, "gain per channel: 1 +- this");
  app->add_option("--occluder", o->observation.occluder,
                  "square over this fraction of the object's box");
  app->add_option("--noise", o->observation.noise, "standard deviation of Gaussian noise");
  app->add_option("--first", o->first, "number of the first image");
  app->add_option("--every", o->every, "only every so many-th image");
  app->add_option("--backend", o->backend.backend, "cpu or cuda")->capture_default_str();
  app->add_option("--threads", o->backend.threads, "of the CPU; 0: all cores");
  app->add_option("--align", o->aligned, "candidates that are aligned, the best score counts");
  app->add_option("--largest", o->largest, "width of the object, of the image's");
  app->add_option("--smallest", o->smallest, "the same");
  app->add_option("--views", o->bank.views, "of the bank");
  app->add_option("--features", o->bank.features, "of a view");
  app->add_option("--view-distance", o->bank.distance, "of the bank's cameras [diameters]");
  app->add_option("--scanned", o->search.matching.scanned_px,
                  "width of the object in scanned images [px]");
  app->add_option("--fitted-px", o->search.matching.fitted_px,
                  "the same where hits are fitted [px]");
  app->add_option("--fitted", o->search.matching.fitted,
                  "best hits of each distance that are fitted");
  app->add_option("--step", o->search.matching.distance_step, "from a distance to the next");
  app->add_option("--rotations", o->search.matching.rotations, "in the image");
  app->add_option("--hits", o->search.matching.hits_per_template, "of each template");
}

int run(int argc, char** argv) {
  CLI::App app("Looks for an object in whole images with templates.");
  Options options;
  options.observation.background = "photo";
  addOptions(&app, &options);
  CLI11_PARSE(app, argc, argv);
  try {
    Benchmark(options).run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "template_detection: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) { return nerf_pose_refiner::run(argc, argv); }
