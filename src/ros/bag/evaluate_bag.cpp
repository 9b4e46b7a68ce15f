// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>
#include <string>

#include "backend/backend.h"
#include "detection/landmark_file.h"
#include "field/object_metadata.h"
#include "ros/bag/bag_evaluation.h"
#include "ros/bag/evaluation_files.h"
#include "tools/refine_case.h"
#include "tools/tool.h"

// A model file and a bag with the truth to errors, shares and latencies.

extern char** environ;

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

constexpr const char* kPlotScript = "plot_evaluation";

struct EvaluateOptions {
  std::string model;
  std::string bag;
  std::string out;
  std::string start = "perturbed";
  bool no_plots = false;
  bool json = false;
  BagTopics topics;
  BagEvaluationSettings settings;
  BackendOptions backend;
};

/// Further cameras, and the one camera from elsewhere.
void declareCameras(CLI::App* app, EvaluateOptions* options) {
  CameraSettings& cameras = options->settings.cameras;
  ViewWindowSettings& window = options->settings.window;
  app->add_option("--cameras", options->topics.cameras,
                  "Topics of images of further cameras, with camera_info beside each; TF has their "
                  "places");
  app->add_option("--cameras-tolerance", options->topics.cameras_tolerance_s,
                  "Largest difference between the stamps of an image and theirs [s]")
      ->capture_default_str();
  app->add_flag("--cameras-rectified", cameras.are_rectified,
                "The images of further cameras are rectified: P applies, not K and D");
  app->add_option("--cameras-position-dev", cameras.position_dev_m,
                  "Standard deviation of their places in TF, along each axis [m]")
      ->capture_default_str();
  app->add_option("--cameras-rotation-dev", cameras.rotation_dev_deg, "About each axis [degrees]")
      ->capture_default_str();
  app->add_option("--window", window.views,
                  "With --track and --fixed-frame: past images that take part as further cameras, "
                  "at most")
      ->capture_default_str();
  app->add_option("--window-apart", window.apart_deg,
                  "Least angle between the lines of sight of two of them [degrees]")
      ->capture_default_str();
  app->add_option("--window-position-dev", window.position_dev_m,
                  "Standard deviation of the camera's place in TF, along each axis [m]")
      ->capture_default_str();
  app->add_option("--window-rotation-dev", window.rotation_dev_deg, "About each axis [degrees]")
      ->capture_default_str();
}

void declareBag(CLI::App* app, EvaluateOptions* options) {
  BagTopics& topics = options->topics;
  app->add_option("model", options->model, "Model file with metric scale")
      ->required()
      ->check(CLI::ExistingFile);
  app->add_option("bag", options->bag, "Recording of images and true poses")
      ->required()
      ->check(CLI::ExistingFile);
  app->add_option("-o,--output", options->out, "Folder for the results; it is created")->required();
  app->add_option(
      "--image", topics.image,
      "Topic of images, raw or compressed; default: the only one of the bag, or of those "
      "in the frame of the true poses");
  app->add_option("--camera-info", topics.camera_info,
                  "Topic of camera_info; default: the one beside the images");
  app->add_flag("--rectified", options->settings.image_is_rectified,
                "The images are rectified: P applies, not K and D");
  app->add_option("--mask", topics.mask, "Topic of masks, not zero on the object, paired by stamp");
  app->add_option("--depth", topics.depth,
                  "Topic of depth images, 16UC1 or 32FC1, with camera_info beside it");
  app->add_option("--depth-tolerance", topics.depth_tolerance_s,
                  "Largest difference between the stamps of an image and its depth [s]")
      ->capture_default_str();
  app->add_flag("--depth-rectified", options->settings.depth.is_rectified,
                "The depth images are rectified: P applies, not K");
  declareCameras(app, options);
  auto* truth = app->add_option("--truth", topics.truth,
                                "Topic of true poses: PoseStamped, PoseWithCovarianceStamped or "
                                "TransformStamped");
  app->add_option("--truth-frame", topics.truth_frame, "TF frame of the object, instead of --truth")
      ->excludes(truth);
  app->add_option("--truth-gap", topics.truth_gap_s,
                  "Longest gap between true poses that is bridged by interpolation [s]")
      ->capture_default_str();
  app->add_option("--initial-pose", topics.initial_pose,
                  "Topic of initial poses, for --start recorded");
  app->add_option("--fixed-frame", topics.fixed_frame,
                  "TF frame in which the object stands still: until an initial pose is used, and "
                  "for --window");
}

void declareTrials(CLI::App* app, EvaluateOptions* options) {
  BagEvaluationSettings& s = options->settings;
  app->add_option("--every", s.every, "Refine every n-th image")->capture_default_str();
  app->add_option("--first", s.first, "Number of the first image")->capture_default_str();
  app->add_option("--frames", s.most, "Largest number of images; 0: all")->capture_default_str();
  app->add_flag("--track", s.track,
                "Track as the node does: from --start only where it has no pose to start from");
  app->add_option(
         "--start", options->start,
         "Initial poses: perturbed (the truth with an error) or recorded; or detect: none, "
         "the object is looked for in the whole image")
      ->check(CLI::IsMember({"perturbed", "recorded", "detect"}))
      ->capture_default_str();
  app->add_option("--start-rotation", s.start_rotation_deg,
                  "Largest error of a perturbed pose about each axis [degrees]")
      ->capture_default_str();
  app->add_option("--start-translation", s.start_translation,
                  "Largest error of a perturbed pose along each axis [object diameters]")
      ->capture_default_str();
  app->add_option("--start-max-age", s.start_max_age_s,
                  "Largest age of a recorded initial pose [s]")
      ->capture_default_str();
  app->add_option("--preset", s.preset, "Preset of the search from an initial pose")
      ->check(CLI::IsMember(RefinerSettings::presetNames()))
      ->capture_default_str();
  app->add_option("--search-rotation", s.search_rotation_deg, "Half width of that search [degrees]")
      ->capture_default_str();
  app->add_option("--search-translation", s.search_translation,
                  "Half width of that search [object diameters]")
      ->capture_default_str();
  app->add_option("--track-preset", s.track_preset, "Preset of the search from the last pose")
      ->check(CLI::IsMember(RefinerSettings::presetNames()))
      ->capture_default_str();
  app->add_option("--trust-score", s.rules.trust_score,
                  "Lowest score of a trusted pose after a search from an initial pose")
      ->capture_default_str();
  app->add_option("--min-score", s.rules.min_score,
                  "Lowest score of a trusted pose after a search from the last pose, with --track")
      ->capture_default_str();
  app->add_option("--max-failures", s.rules.max_failures,
                  "Untrusted images in a row that --track bridges")
      ->capture_default_str();
  app->add_flag("!--no-prediction", s.rules.predict,
                "With --track: search around the last pose, not where the motion leads, and take "
                "each pose as found");
  app->add_option("--points", s.points, "Points of the surface, for ADD, ADD-S and reprojection")
      ->capture_default_str();
  app->add_option("--seed", s.seed,
                  "Seed of initial poses, searches and points: same seed, same numbers")
      ->capture_default_str();
}

void declare(CLI::App* app, EvaluateOptions* options) {
  const std::string name = app->get_name();
  app->description(
      "Refines the images of a bag one by one and compares the poses with the truth.\n\n"
      "The bag is read from its file, without a ROS graph: no image is dropped, and poses do not\n"
      "depend on a clock. Writes frames.csv, summary.json, plots and index.html, which shows "
      "them.");
  app->footer("Examples:\n  " + name +
              " kiosk.safetensors kiosk.bag --truth /ground_truth/object_pose -o out\n  " + name +
              " mug.safetensors mug.bag --truth-frame mug_true --track --every 3 -o out\n\n" +
              kExitCodes);
  declareBag(app, options);
  declareTrials(app, options);
  options->backend.addTo(app);
  app->add_flag("--no-plots", options->no_plots, "Neither plots nor the page");
  app->add_flag("--json", options->json, "Print the summary as JSON");
}

nlohmann::json settingsJson(const EvaluateOptions& options, const BagTopics& topics,
                            const FieldMetadata& object, const std::string& backend) {
  const BagEvaluationSettings& s = options.settings;
  return {{"model", fs::absolute(options.model).string()},
          {"object", object.name},
          {"data_hash", object.data_hash},
          {"bag", fs::absolute(options.bag).string()},
          {"image", topics.image},
          {"mask", topics.mask},
          {"depth", topics.depth},
          {"cameras", topics.cameras},
          {"fixed_frame", topics.fixed_frame},
          {"window", s.window.views},
          {"truth", topics.truth.empty() ? "TF frame " + topics.truth_frame : topics.truth},
          {"every", s.every},
          {"first", s.first},
          {"track", s.track},
          {"start", options.start},
          {"start_rotation_deg", s.start_rotation_deg},
          {"start_translation_diameters", s.start_translation},
          {"preset", s.preset},
          {"search_rotation_deg", s.search_rotation_deg},
          {"search_translation_diameters", s.search_translation},
          {"track_preset", s.track_preset},
          {"trust_score", s.rules.trust_score},
          {"min_score", s.rules.min_score},
          {"surface_points_asked", s.points},
          {"modulo_symmetries", describe(object.symmetries)},
          {"seed", s.seed},
          {"engine", backend}};
}

/// Runs the script that lies beside this program.
void plot(const std::string& folder) {
  const fs::path script = fs::read_symlink("/proc/self/exe").parent_path() / kPlotScript;
  std::string program = script.string(), argument = folder;
  char* arguments[] = {program.data(), argument.data(), nullptr};
  pid_t child = 0;
  const int error = posix_spawn(&child, program.c_str(), nullptr, nullptr, arguments, environ);
  if (error != 0) {
    throw std::runtime_error("cannot run '" + program + "': " + std::strerror(error));
  }
  int status = 0;
  if (waitpid(child, &status, 0) != child || !WIFEXITED(status) || WEXITSTATUS(status) != 0) {
    throw std::runtime_error("'" + program + "' failed; the CSV and the JSON are in " + folder);
  }
}

BagEvaluationResult evaluateAll(const BagSequence& bag, BagEvaluation* evaluation,
                                const CancellationToken& cancellation) {
  ProgressLine line;
  const auto show = [&](const EvaluatedFrame& frame) {
    char text[120];
    std::snprintf(text, sizeof text, "image %d of %d: %.2f degrees, %.2f %% of the diameter",
                  frame.index + 1, bag.size(), frame.found.rotation_deg,
                  100 * frame.found.offset_diameters);
    line.show(static_cast<double>(frame.index + 1) / bag.size(), text);
  };
  return evaluation->run(show, cancellation);
}

void evaluate(const EvaluateOptions& given, const CancellationToken& cancellation) {
  EvaluateOptions options = given;
  if (options.start == "recorded") options.settings.start = StartMode::kRecorded;
  if (options.start == "detect") options.settings.start = StartMode::kDetected;
  options.settings.landmarks_path = landmarkPathOf(options.model);
  if (options.start == "recorded" && options.topics.initial_pose.empty()) {
    throw std::invalid_argument("--start recorded needs --initial-pose");
  }
  const auto field = std::make_shared<const Field>(loadField(options.model));
  const FieldMetadata& object = field->metadata;
  const BagSequence bag(options.bag, options.topics);
  const std::shared_ptr<Backend> backend = options.backend.make();
  BagEvaluation evaluation(bag, backend, field, options.settings);
  fs::create_directories(options.out);
  requireWritable(options.out + "/");
  const BagEvaluationResult result = evaluateAll(bag, &evaluation, cancellation);
  if (result.frames.empty()) {
    std::string reasons;
    for (const auto& [reason, count] : result.skipped) {
      reasons += "; " + std::to_string(count) + ": " + reason;
    }
    throw std::runtime_error("no image of " + bag.topics().image + " could be evaluated" + reasons);
  }
  nlohmann::json summary = summaryJson(result, object.metres_per_unit * object.diameter);
  summary["settings"] = settingsJson(options, bag.topics(), object, backend->info().description);
  writeFramesCsv(result, options.out + "/frames.csv");
  writeJson(summary, options.out + "/summary.json");
  if (!options.no_plots) plot(options.out);
  if (options.json) {
    printJson(summary);
  } else {
    std::printf("%s", summaryText(summary).c_str());
  }
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  return nerf_pose_refiner::runTool(argc, argv, nerf_pose_refiner::declare,
                                    nerf_pose_refiner::evaluate);
}
