// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <stdexcept>
#include <string>
#include <vector>

#include "backend/backend.h"
#include "backend/common/draw_overlay.h"
#include "backend/loaded_field.h"
#include "dataset/dataset.h"
#include "evaluation/trial.h"
#include "evaluation/trial_observation.h"
#include "evaluation/trial_results.h"
#include "field/model_file.h"
#include "image/io.h"
#include "tools/tool.h"
#include "tools/tracker_trials.h"
#include "tools/trial_shard.h"

// Runs the trials of a plan on the scenes of a data folder. What is there already is not run again.

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t kStartsPerView = 1000;  // of the numbers that starts are drawn by

struct EvaluateOptions {
  std::string data, models, experiments, output;
  std::vector<std::string> only, scenes, photos;
  std::string shard = "0/1";
  int images = 0;
  bool check_plan = false;
  BackendOptions backend;
};

void declare(CLI::App* app, EvaluateOptions* options) {
  app->description(
      "Runs trials of pose refinement: views of the scenes below a folder, each started from\n"
      "wrong poses, as a plan says (config/experiments.json). Writes one line per trial; trials\n"
      "that are there already are not run again. scripts/tabulate_trials makes tables and plots of "
      "it.");
  app->footer("Example:\n  " + app->get_name() +
              " scenes --models models --experiments config/experiments.json -o results --backend "
              "auto\n\n" +
              kExitCodes);
  app->add_option(
         "data", options->data,
         "Folder of scenes: folders with a transforms_test.json, three levels deep at most")
      ->required()
      ->check(CLI::ExistingDirectory);
  app->add_option(
         "--models", options->models,
         "Folder of models, <scene>.safetensors, and <scene>.<profile>.safetensors where a plan "
         "names a profile")
      ->required()
      ->check(CLI::ExistingDirectory);
  app->add_option("--experiments", options->experiments, "Plan: which trials there are (JSON)")
      ->required()
      ->check(CLI::ExistingFile);
  app->add_option("-o,--output", options->output, "Folder for the trials' lines")->required();
  app->add_option("--only", options->only, "Names of experiments; default: all of the plan");
  app->add_option("--scene", options->scenes, "Names of scenes; default: all below the folder");
  app->add_option(
         "--photo", options->photos,
         "Images, of which one is drawn to be put behind the object; default: drawn clutter")
      ->check(CLI::ExistingFile);
  app->add_option("--shard", options->shard, "i/n: one of n parts of the trials, i from 0")
      ->capture_default_str();
  app->add_option("--pictures", options->images,
                  "Draw start and result over the image: first start of so many views of each "
                  "scene, condition and method")
      ->check(CLI::NonNegativeNumber)
      ->capture_default_str();
  app->add_flag("--check-plan", options->check_plan,
                "Check the plan and the names of scenes and experiments, and run nothing");
  options->backend.addTo(app);
}

bool isWanted(const std::vector<std::string>& wanted, const std::string& name) {
  return wanted.empty() || std::find(wanted.begin(), wanted.end(), name) != wanted.end();
}

/// @throws std::invalid_argument for a wanted name that there is not.
void requireKnown(const std::vector<std::string>& wanted, const std::set<std::string>& known,
                  const char* what) {
  for (const std::string& name : wanted) {
    if (known.count(name) == 0) throw std::invalid_argument("no " + (what + (" '" + name + "'")));
  }
}

/// The scenes of the folder. @throws std::runtime_error if there are none, std::invalid_argument
/// for a name of a scene or an experiment that there is not.
std::vector<Scene> checkedScenes(const EvaluateOptions& options, const ExperimentPlan& plan) {
  const std::vector<Scene> scenes = findScenes(options.data);
  std::set<std::string> names, experiments;
  for (const Scene& scene : scenes) names.insert(scene.name);
  for (const Experiment& experiment : plan.experiments) experiments.insert(experiment.name);
  requireKnown(options.scenes, names, "scene");
  requireKnown(options.only, experiments, "experiment");
  return scenes;
}

/// A scene whose trials are run.
struct LoadedScene {
  std::string name;
  SceneKind kind;
  Dataset dataset;
  /// By the profile that a variant asks for, loaded when one does; that of the scene itself is "".
  std::map<std::string, std::shared_ptr<const LoadedField>> fields;

  const FieldMetadata& object() const { return fields.at("")->field().metadata; }
};

/// Starts of one image that one method searches together.
struct Batch {
  const LoadedScene& scene;
  const Experiment& experiment;
  const SearchVariant& variant;
  std::vector<TrialKey> keys;
};

SceneKind kindOf(const Dataset& dataset) {
  if (dataset.has_masks) return SceneKind::kMasked;
  return dataset.has_alpha ? SceneKind::kSynthetic : SceneKind::kForwardFacing;
}

class Evaluation {
 public:
  Evaluation(const EvaluateOptions& options, const CancellationToken& cancellation)
      : options_(options),
        cancellation_(cancellation),
        shard_(options.shard),
        plan_(loadExperiments(options.experiments)),
        backend_(options.backend.make()),
        results_(options.output, shard_.suffix(), backend_->info().description) {}

  void run() {
    for (const Scene& scene : checkedScenes(options_, plan_)) {
      if (isWanted(options_.scenes, scene.name)) runScene(scene);
    }
    line_.end();
    std::printf("%zu trials, %d of them new, on %s\n", results_.size(), done_,
                backend_->info().description.c_str());
  }

 private:
  void runScene(const Scene& scene) {
    LoadedScene loaded;
    loaded.name = scene.name;
    loaded.dataset = loadDataset(scene.test_path, options_.backend.datasetOptions(), cancellation_);
    loaded.kind = kindOf(loaded.dataset);
    loadSceneField("", &loaded);
    for (const Experiment& experiment : plan_.experiments) {
      const auto& kinds = experiment.kinds;
      if (!isWanted(options_.only, experiment.name)) continue;
      if (std::find(kinds.begin(), kinds.end(), loaded.kind) == kinds.end()) continue;
      for (const SearchVariant& variant : experiment.variants)
        loadSceneField(variant.profile, &loaded);
      for (const std::string& condition : experiment.conditions) {
        runCondition(loaded, experiment, condition);
      }
    }
  }

  void loadSceneField(const std::string& profile, LoadedScene* scene) {
    std::shared_ptr<const LoadedField>& field = scene->fields[profile];
    if (field) return;
    const std::string name = scene->name + (profile.empty() ? "" : "." + profile) + ".safetensors";
    const fs::path path = fs::path(options_.models) / name;
    field = backend_->load(std::make_shared<const Field>(loadModel(path.string())));
  }

  void runCondition(const LoadedScene& scene, const Experiment& experiment,
                    const std::string& condition) {
    TrialObservation disturbance =
        TrialObservation::named(condition, scene.kind == SceneKind::kMasked ? "own" : "alpha");
    disturbance.seed = plan_.seed;
    disturbance.photos = options_.photos;
    const int available = static_cast<int>(scene.dataset.views.size());
    for (const int v : chosenViews(experiment.views, available)) {
      std::optional<TrialImage> image;  // made when a trial needs it
      forEachBatch(scene, experiment, condition, v, [&](const Batch& batch) {
        if (!image) image = disturbance.imageOf(scene.dataset.views, static_cast<std::size_t>(v));
        runBatch(batch, *image);
      });
    }
  }

  /// Calls `run` for each set of starts of the view that is this process' and lacks a result.
  template <typename Run>
  void forEachBatch(const LoadedScene& scene, const Experiment& experiment,
                    const std::string& condition, int view, const Run& run) {
    for (const SearchVariant& variant : experiment.variants) {
      for (const std::string& method : experiment.methods) {
        // Alignment has a loss of its own, and iNeRF is what its authors made it: L2.
        const bool has_losses = method == "single" || method == "multiple";
        const auto losses = has_losses ? experiment.losses
                                       : std::vector<std::string>{method == "inerf" ? "l2" : ""};
        for (const std::string& loss : losses) {
          cancellation_.check();
          const TrialKey first = {
              experiment.name, scene.name, sceneKindName(scene.kind), method, loss,
              variant.label,   condition,  experiment.protocol,       view,   0};
          if (!shard_.has(first)) continue;
          const int at_once = startsAtOnce(method);
          for (int start = 0; start < experiment.starts; start += at_once) {
            std::vector<TrialKey> keys(std::min(at_once, experiment.starts - start), first);
            for (std::size_t i = 0; i < keys.size(); ++i)
              keys[i].start = start + static_cast<int>(i);
            const bool complete =
                std::all_of(keys.begin(), keys.end(),
                            [this](const TrialKey& key) { return results_.has(key); });
            if (!complete) run(Batch{scene, experiment, variant, keys});
          }
        }
      }
    }
  }

  /// Inversions fill a device better together; where nothing is gained by it, less is lost by an
  /// interruption.
  int startsAtOnce(const std::string& method) const {
    const bool is_inversion = method == "inerf" || method == "single" || method == "multiple";
    return is_inversion ? backend_->info().searches_at_once : 1;
  }

  /// Starts that an earlier process has written are searched again, for a search's samples depend a
  /// little on the others', and are not written.
  void runBatch(const Batch& batch, const TrialImage& shown) {
    const std::vector<TrialKey>& keys = batch.keys;
    const PosedView& view = shown.view;
    const FieldMetadata& object = batch.scene.object();
    const TrialProtocol protocol(batch.experiment.protocol, batch.scene.kind, object);
    const TrialScale scale = {protocol.unit, object.diameter};
    const TrialKey& first = keys.front();
    std::vector<Prior> priors;
    for (const TrialKey& key : keys) {
      priors.push_back(
          protocol.prior(view.T_O_C, object, plan_.seed, kStartsPerView * key.view + key.start));
    }
    const Observation image = trialImage(shown.observation, first.method, batch.variant);
    const auto errorOf = [&](const Pose& T_O_C) {
      return poseError(T_O_C, view.T_O_C, object.centre, view.camera, object.symmetries);
    };
    std::vector<Refinement> refinements;
    if (first.method == "detection") {
      const bool is_group = TrialObservation::named(first.condition, "alpha").is_group;
      const Detections detections = trackerOf(batch).detect(image, is_group);
      refinements.assign(keys.size(), ofFirstInstance(detections, errorOf));
      const std::vector<Sighting> sightings =
          sightingsOf(shown.instances, detections.found, view.camera, object);
      if (!results_.has(first)) results_.addSightings(first, sightings, object.diameter);
    } else {
      refinements = refineAll(batch, protocol.unit, image, priors);
    }
    cancellation_.check();  // what was interrupted is no result
    for (std::size_t i = 0; i < keys.size(); ++i) {
      if (results_.has(keys[i])) continue;
      const Refinement& refinement = refinements[i];
      if (batch.experiment.traces) {
        results_.addTrace(keys[i], priors[i].T_O_C, refinement, scale.unit, errorOf);
      }
      results_.add(keys[i], refinement, errorOf(priors[i].T_O_C), errorOf(refinement.T_O_C), scale);
      ++done_;
    }
    if (isDrawn(batch)) {
      drawTrial(batch, shown.observation, priors.front().T_O_C, refinements.front().T_O_C);
    }
    line_.show(0, first.scene + " " + first.experiment + " " + first.condition + ": view " +
                      std::to_string(first.view) + ", " + std::to_string(done_) + " trials");
  }

  /// Of the batch's scene and profile.
  TrackerTrials& trackerOf(const Batch& batch) {
    std::unique_ptr<TrackerTrials>& tracker = trackers_[batch.scene.name + batch.variant.profile];
    if (!tracker) {
      const fs::path model = fs::path(options_.models) / (batch.scene.name + ".safetensors");
      tracker = std::make_unique<TrackerTrials>(
          backend_, batch.scene.fields.at(batch.variant.profile), model.string(), cancellation_);
    }
    return *tracker;
  }

  /// The pose nearest to the view's own.
  template <typename ErrorOf>
  static Refinement ofFirstInstance(const Detections& detections, const ErrorOf& error_of) {
    Refinement nearest;
    double least = std::numeric_limits<double>::infinity();
    for (const Refinement& one : detections.found) {
      const double offset = error_of(one.T_O_C).object_offset;
      if (offset < least) nearest = one;
      least = std::min(least, offset);
    }
    nearest.seconds = detections.seconds;
    return nearest;
  }

  std::vector<Refinement> refineAll(const Batch& batch, double unit, const Observation& image,
                                    const std::vector<Prior>& priors) {
    const LoadedField& field = *batch.scene.fields.at(batch.variant.profile);
    const TrialKey& key = batch.keys.front();
    if (key.method == "keyframes") {
      std::vector<Refinement> found;
      for (const Prior& prior : priors) found.push_back(trackerOf(batch).search(image, prior));
      return found;
    }
    const RefinerSettings settings = trialSettings(key.method, key.loss.empty() ? "l2" : key.loss,
                                                   batch.variant, unit, plan_.seed);
    TrialKey likewise = key;
    likewise.view = likewise.start = 0;
    if (backend_->info().warms_up && warmed_.insert(likewise.cells()).second) {
      // A few steps make memory and graphs.
      RefinerSettings brief = settings;
      brief.inversion.first_steps = brief.inversion.descent.score_steps;
      brief.inversion.rounds = 0;
      FieldRefiner(backend_, brief).refineAll(field, image, priors, cancellation_);
    }
    return FieldRefiner(backend_, settings).refineAll(field, image, priors, cancellation_);
  }

  /// The first start of the first views, by the first variant.
  bool isDrawn(const Batch& batch) const {
    const TrialKey& first = batch.keys.front();
    if (first.start != 0 || first.variant != batch.experiment.variants.front().label) return false;
    const int available = static_cast<int>(batch.scene.dataset.views.size());
    const std::vector<int> views = chosenViews(batch.experiment.views, available);
    return std::find(views.begin(), views.end(), first.view) - views.begin() < options_.images;
  }

  /// The batch's first start and its result, side by side, over the image in grey.
  void drawTrial(const Batch& batch, const Observation& observation, const Pose& start,
                 const Pose& found) {
    const TrialKey& key = batch.keys.front();
    const Camera& camera = observation.camera;
    Image8 pair(2 * camera.width, camera.height, 3);
    for (int side = 0; side < 2; ++side) {
      const Rendering rendering =
          batch.scene.fields.at("")->render({camera, side == 0 ? start : found}, {}, cancellation_);
      const Image8 overlay = drawOverlay(observation.image, rendering, 0.7);
      for (int y = 0; y < camera.height; ++y) {
        std::copy(overlay.pixel(0, y), overlay.pixel(0, y) + 3 * camera.width,
                  pair.pixel(side * camera.width, y));
      }
    }
    const fs::path folder = fs::path(options_.output) / "pictures";
    fs::create_directories(folder);
    const std::string loss = key.loss.empty() ? "" : "_" + key.loss;
    writePng(pair, (folder / (key.experiment + "_" + key.scene + "_" + key.condition + "_" +
                              key.method + loss + "_" + std::to_string(key.view) + ".png"))
                       .string());
  }

  const EvaluateOptions& options_;
  const CancellationToken& cancellation_;
  const Shard shard_;
  const ExperimentPlan plan_;
  std::shared_ptr<Backend> backend_;
  TrialResults results_;
  ProgressLine line_;
  std::map<std::string, std::unique_ptr<TrackerTrials>> trackers_;  // by scene and profile
  std::set<std::vector<std::string>> warmed_;  // trials whose like has its memory and graphs
  int done_ = 0;
};

void evaluate(const EvaluateOptions& options, const CancellationToken& cancellation) {
  if (options.check_plan) {
    checkedScenes(options, loadExperiments(options.experiments));
    return;
  }
  Evaluation(options, cancellation).run();
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  return nerf_pose_refiner::runTool(argc, argv, nerf_pose_refiner::declare,
                                    nerf_pose_refiner::evaluate);
}
