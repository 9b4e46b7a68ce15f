// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <cstdio>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "dataset/dataset.h"
#include "evaluation/pose_error.h"
#include "evaluation/start.h"
#include "field/object_frame.h"
#include "field/object_metadata.h"
#include "image/io.h"
#include "math/angle.h"
#include "refinement/field_refiner.h"
#include "tools/depth_options.h"
#include "tools/refine_case.h"
#include "tools/tool.h"
#include "tracking/object_search.h"
#include "tracking/settings.h"
#include "trust/check_trust.h"

// A model file, an image and a rough pose to a refined pose.

namespace nerf_pose_refiner {
namespace {

struct RefineOptions {
  std::string model;
  std::string image;
  std::vector<double> intrinsics;  // fx fy cx cy
  std::vector<double> distortion;  // k1 k2 p1 p2 [k3 [k4 k5 k6]]
  std::vector<double> pose;        // T_C_O: x y z qx qy qz qw
  std::string transforms;
  std::string view;
  double start_rotation_deg = 15;
  double start_translation = 0.15;
  std::string preset = "keyframes";
  double search_rotation_deg = kSearchRotation_deg;
  double search_translation = kSearchTranslation;
  std::vector<float> background;  // r g b, 0..1
  std::string mask;
  DepthOptions depth;
  double min_score = TrackingRules().min_score;
  std::uint64_t seed = 1;
  bool json = false;
  BackendOptions backend;
};

void declareInput(CLI::App* app, RefineOptions* options) {
  app->add_option("model", options->model, "Model file")->required()->check(CLI::ExistingFile);
  auto* image = app->add_option("image", options->image, "Camera image (PNG, JPEG, ...)")
                    ->check(CLI::ExistingFile);
  auto* transforms =
      app->add_option("--transforms", options->transforms,
                      "Instead of an image: a view of this transforms.json, from a wrong start")
          ->check(CLI::ExistingPath)
          ->excludes(image);
  app->add_option("--intrinsics", options->intrinsics,
                  "fx fy cx cy [px; the centre of the first pixel is 0, 0]")
      ->expected(4)
      ->excludes(transforms);
  auto* distortion =
      app->add_option("--distortion", options->distortion, "k1 k2 p1 p2 [k3 [k4 k5 k6]]")
          ->expected(4, 8)
          ->needs(image);
  app->add_option("--pose", options->pose,
                  "Rough pose of the object in the camera's optical frame: x y z qx qy qz qw "
                  "[model units]")
      ->expected(7)
      ->excludes(transforms);
  options->depth
      .addTo(app, "Depth beside the image, pixel for pixel, or instead of one: PNG of 16-bit grey")
      ->excludes(transforms)
      ->excludes(distortion);
  app->add_option("--view", options->view, "File name of the view; default: the first")
      ->needs(transforms);
  app->add_option("--start-rotation", options->start_rotation_deg,
                  "Largest error of a view's initial pose about each axis [degrees]")
      ->capture_default_str();
  app->add_option("--start-translation", options->start_translation,
                  "Largest error of a view's initial pose along each axis [object diameters]")
      ->capture_default_str();
}

void declare(CLI::App* app, RefineOptions* options) {
  const std::string name = app->get_name();
  app->description(
      "Refines a rough pose of an object until its rendering matches an image.\n\n"
      "The background may be known: from --mask, from --background, or because the\n"
      "image has alpha. The presets align and track search with that; keyframes searches\n"
      "without, and does not trust a pose that a mask contradicts.\n\n"
      "With the preset keyframes, --depth takes part beside the image, or shows the object "
      "alone.\n\n"
      "Poses are those of the object frame in <model>.yaml, if there is that file.");
  app->footer(
      "Examples:\n  " + name +
      " mug.safetensors photo.jpg --intrinsics 500 500 319.5 239.5"
      " --pose 0.02 0 0.6 1 0 0 0 --json\n  " +
      name + " mug.safetensors --transforms photos/mug/transforms_test.json --view view_003\n\n" +
      kExitCodes +
      "\nIt is a failure if no pose is found, or its score is below --min-score: the pose is "
      "printed,\nbut is not to be trusted.");
  declareInput(app, options);
  app->add_option(
         "--preset", options->preset,
         "How to search: keyframes (as the node does), align (coarse to fine), track (from a "
         "near pose), paper, paper_single (Lin et al.), inerf (Yen-Chen et al.)")
      ->check(CLI::IsMember(RefinerSettings::presetNames()))
      ->capture_default_str();
  app->add_option("--search-rotation", options->search_rotation_deg,
                  "Half width of the search about each axis [degrees]")
      ->capture_default_str();
  app->add_option("--search-translation", options->search_translation,
                  "Half width of the search along each axis [object diameters]")
      ->capture_default_str();
  auto* background = app->add_option("--background", options->background,
                                     "Red, green, blue behind the object [0..1]");
  background->expected(3)->check(CLI::Range(0.0, 1.0));
  app->add_option("--mask", options->mask, "Image of the same size, black where the object is not")
      ->check(CLI::ExistingFile)
      ->excludes(background);
  app->add_option(
         "--min-score", options->min_score,
         "A pose with a lower score is a failure; the default is that of the node while it "
         "tracks. 0: any score will do")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app->add_option("--seed", options->seed, "Same seed, same answer")->capture_default_str();
  options->backend.addTo(app);
  app->add_flag("--json", options->json, "Print the result as JSON");
}

/// The depth of the image, or, where there is none, depth alone.
void addDepthFile(const RefineOptions& options, const FieldMetadata& object, RefineCase* input) {
  ImageOf<std::uint16_t> values = options.depth.read(object);
  if (input->image.empty()) {
    if (!options.mask.empty() || !options.background.empty()) {
      throw std::invalid_argument("depth alone takes neither --mask nor --background");
    }
    input->camera = cameraFromNumbers(options.intrinsics, values.width, values.height);
  }
  options.depth.giveTo(std::move(values), input);
}

RefineCase caseOfImage(const RefineOptions& options, const FieldMetadata& object) {
  if (options.intrinsics.empty() || options.pose.empty()) {
    throw std::invalid_argument("give --intrinsics and --pose with an image");
  }
  RefineCase result;
  if (!options.image.empty()) {
    const Image8 photo = readImage(options.image);
    result = caseOfPhoto(photo, options.mask.empty() ? Image8() : readMask(options.mask),
                         cameraFromNumbers(options.intrinsics, photo.width, photo.height),
                         Distortion{options.distortion});
  }
  if (!options.depth.file.empty()) addDepthFile(options, object, &result);
  result.name = options.image.empty() ? options.depth.file : options.image;
  result.start_T_O_C =
      ObjectFrame::inModelUnits(object).cameraInModel(poseFromNumbers(options.pose));
  return result;
}

const PosedView& findView(const Dataset& dataset, const std::string& name) {
  for (const PosedView& view : dataset.views) {
    if (name.empty() || fileName(view.name) == name || fileStem(view.name) == name) return view;
  }
  throw std::invalid_argument("no view '" + name + "' in " + dataset.folder);
}

RefineCase caseOfDataset(const RefineOptions& options, const FieldMetadata& object,
                         const CancellationToken& cancellation) {
  const Dataset dataset =
      loadDataset(options.transforms, options.backend.datasetOptions(), cancellation);
  const PosedView& view = findView(dataset, options.view);
  const StartSpread spread = {options.start_rotation_deg / kDegreesPerRad,
                              options.start_translation * object.diameter, true};
  RefineCase result = caseOfView(view, options.mask.empty() ? Image8() : readMask(options.mask));
  result.start_T_O_C = perturbedStart(view.T_O_C, spread, object.centre, options.seed, 0);
  return result;
}

const char* nameOf(Outcome outcome) {
  switch (outcome) {
    case Outcome::kRefined:
      return "refined";
    case Outcome::kNoOverlap:
      return "no overlap: the start lies wholly outside of the image";
    case Outcome::kBadSize:
      return "bad size: the object would be far larger than the image, or only a few pixels wide";
    case Outcome::kDiverged:
      return "diverged: no hypothesis survived";
    case Outcome::kCancelled:
      break;
  }
  return "stopped";
}

nlohmann::json errorJson(const PoseError& error, double diameter) {
  return {{"rotation_deg", error.rotation_rad * kDegreesPerRad},
          {"diameters", error.object_offset / diameter},
          {"pixels", error.pixels}};
}

bool isTrusted(const Refinement& result, double min_score) {
  return checkTrust(result, min_score) == TrustVerdict::kTrusted;
}

nlohmann::json resultJson(const RefineCase& input, const Refinement& result,
                          const FieldMetadata& object, double min_score) {
  const ObjectFrame frame = ObjectFrame::inModelUnits(object);
  const Pose T_C_U = frame.objectInCamera(result.T_O_C);
  nlohmann::json document = {{"image", input.name},
                             {"outcome", nameOf(result.outcome)},
                             {"pose", poseNumbers(T_C_U)},
                             {"score", result.score},
                             {"trusted", isTrusted(result, min_score)},
                             {"visible_fraction", result.visible_fraction},
                             {"seconds", result.seconds},
                             {"samples", result.work.samples}};
  if (object.metres_per_unit > 0) {
    document["pose_m"] = poseNumbers(ObjectFrame::inMetres(object).objectInCamera(result.T_O_C));
  }
  if (input.depth) document["depth"] = depthJson(result.depth);
  if (input.true_T_O_C) {
    const auto error = [&](const Pose& T_O_C) {
      return errorJson(
          poseError(T_O_C, *input.true_T_O_C, object.centre, input.camera, object.symmetries),
          object.diameter);
    };
    document["error_at_start"] = error(input.start_T_O_C);
    document["error"] = error(result.T_O_C);
    document["modulo_symmetries"] = describe(object.symmetries);
  }
  for (const TraceEntry& entry : result.trace) {
    document["trace"].push_back({{"stage", entry.stage},
                                 {"seconds", entry.seconds},
                                 {"samples", entry.work.samples},
                                 {"hypotheses", entry.live},
                                 {"loss", entry.best_loss},
                                 {"pose", poseNumbers(frame.objectInCamera(entry.best_T_O_C))}});
  }
  return document;
}

void printErrorLine(const char* when, const nlohmann::json& error) {
  std::printf("%s: %.2f degrees, %.2f %% of the diameter, %.1f px\n", when,
              error["rotation_deg"].get<double>(), 100 * error["diameters"].get<double>(),
              error["pixels"].get<double>());
}

void printResult(const nlohmann::json& result) {
  std::printf("%s in %.2f s, score %.2f\n", result["outcome"].get<std::string>().c_str(),
              result["seconds"].get<double>(), result["score"].get<double>());
  std::printf("pose (x y z qx qy qz qw):");
  for (double number : result["pose"]) std::printf(" %.6f", number);
  std::printf("\n");
  if (result.contains("depth")) {
    const std::string message = result["depth"]["message"];
    std::printf("depth: %s%s%s\n", result["depth"]["use"].get<std::string>().c_str(),
                message.empty() ? "" : ", ", message.c_str());
  }
  if (result.contains("error")) {
    printErrorLine("error at start", result["error_at_start"]);
    printErrorLine("error", result["error"]);
    const std::string symmetries = result["modulo_symmetries"];
    if (!symmetries.empty()) std::printf("errors are modulo symmetries: %s\n", symmetries.c_str());
  }
}

/// As the node finds an object that it does not track yet.
Refinement refineBy(const RefinerSettings& settings, const std::shared_ptr<Backend>& backend,
                    const std::shared_ptr<const Field>& field, const SearchRequest& request,
                    const CancellationToken& cancellation) {
  if (settings.method == Method::kKeyframes) {
    RefinerSearch search([backend] { return SearchProcessor{backend}; }, settings, settings);
    search.use(field);
    return search.search(request, cancellation);
  }
  return FieldRefiner(backend, settings)
      .refine(*backend->load(field), request.observation, request.prior, cancellation);
}

void refine(const RefineOptions& options, const CancellationToken& cancellation) {
  const bool has_image = !options.image.empty() || !options.depth.file.empty();
  if (has_image != options.transforms.empty()) {
    throw std::invalid_argument("give an image, or --transforms");
  }
  RefinerSettings settings = RefinerSettings::named(options.preset);
  if (!options.depth.file.empty() && settings.method != Method::kKeyframes) {
    throw std::invalid_argument("--preset " + options.preset +
                                " compares colours alone: --depth needs --preset keyframes");
  }
  const auto field = std::make_shared<const Field>(loadField(options.model));
  const FieldMetadata& object = field->metadata;
  const RefineCase input =
      has_image ? caseOfImage(options, object) : caseOfDataset(options, object, cancellation);
  settings.seed = options.seed;
  settings.keyframes.real_time = false;  // there is no next image to be in time for
  const Observation observation = observationOf(input, options.background);
  const std::shared_ptr<Backend> backend = options.backend.make();
  const Prior prior = {input.start_T_O_C, options.search_rotation_deg / kDegreesPerRad,
                       options.search_translation};
  const Refinement result =
      refineBy(settings, backend, field, {observation, prior, false, 0}, cancellation);
  const nlohmann::json document = resultJson(input, result, object, options.min_score);
  if (options.json) {
    printJson(document);
  } else {
    printResult(document);
  }
  if (result.outcome != Outcome::kRefined) throw std::runtime_error(nameOf(result.outcome));
  if (!isTrusted(result, options.min_score)) {
    throw std::runtime_error("the score is " + std::to_string(result.score) +
                             ", which is below --min-score " + std::to_string(options.min_score) +
                             ": the pose is not to be trusted");
  }
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  return nerf_pose_refiner::runTool(argc, argv, nerf_pose_refiner::declare,
                                    nerf_pose_refiner::refine);
}
