// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <cstdio>
#include <string>
#include <vector>

#include "backend/backend.h"
#include "backend/common/draw_overlay.h"
#include "backend/loaded_field.h"
#include "image/io.h"
#include "nerf_pose_refiner/detector.h"
#include "tools/depth_options.h"
#include "tools/refine_case.h"
#include "tools/tool.h"
#include "views/object_inside.h"

// A model file and an image to the poses of the object in it.

namespace nerf_pose_refiner {
namespace {

struct DetectOptions {
  std::string model, image, mask, landmarks, overlay;
  std::vector<double> intrinsics;  // fx fy cx cy
  std::vector<double> distortion;  // k1 k2 p1 p2 [k3 [k4 k5 k6]]
  std::vector<double> box;         // x_min y_min x_max y_max
  double distance = 0;
  DepthOptions depth;
  DetectorOptions detector;
  bool json = false;
  BackendOptions backend;
};

void declare(CLI::App* app, DetectOptions* options) {
  app->description(
      "Finds an object in an image, without a rough pose: all instances of it that explain the\n"
      "image well enough, best first.\n\n"
      "Poses are those of the object frame in <model>.yaml, if there is that file, in metres "
      "where\n"
      "the object knows its scale.");
  app->footer(
      "Example:\n  " + app->get_name() +
      " mug.safetensors photo.jpg --intrinsics 500 500 319.5 239.5 --overlay found.png\n\n" +
      kExitCodes + "\nIt is a failure if the object is not found.");
  app->add_option("model", options->model, "Model file")->required()->check(CLI::ExistingFile);
  app->add_option("image", options->image, "Camera image (PNG, JPEG, ...)")
      ->required()
      ->check(CLI::ExistingFile);
  app->add_option("--intrinsics", options->intrinsics,
                  "fx fy cx cy [px; the centre of the first pixel is 0, 0]")
      ->required()
      ->expected(4);
  auto* distortion =
      app->add_option("--distortion", options->distortion, "k1 k2 p1 p2 [k3 [k4 k5 k6]]")
          ->expected(4, 8);
  app->add_option("--mask", options->mask, "Image of the same size, black where the object is not")
      ->check(CLI::ExistingFile);
  app->add_option("--box", options->box,
                  "x_min y_min x_max y_max of the object in the undistorted image [px]")
      ->expected(4);
  app->add_option("--distance", options->distance,
                  "Rough distance of the object from the camera, give or take a third")
      ->check(CLI::PositiveNumber);
  options->depth.addTo(app, "Depth beside the image, pixel for pixel: PNG of 16-bit grey")
      ->excludes(distortion);
  app->add_option("--landmarks", options->landmarks,
                  "File that keeps the object's landmarks; default: <model>.landmarks");
  app->add_option("--max-instances", options->detector.max_instances, "Of the object in the image")
      ->check(CLI::Range(1, 1000))
      ->capture_default_str();
  app->add_option("--trust-score", options->detector.trust_score,
                  "A pose with a lower score is not shown")
      ->check(CLI::Range(0.0, 1.0))
      ->capture_default_str();
  app->add_option("--overlay", options->overlay, "Draw what was found over the image (PNG)");
  options->backend.addTo(app);
  app->add_flag("--json", options->json, "Print the result as JSON");
}

nlohmann::json resultJson(const DetectOptions& options, const Object& object,
                          const DetectionResult& result) {
  nlohmann::json document = {{"image", options.image},
                             {"unit", object.hasScale() ? "m" : "model units"},
                             {"message", result.message},
                             {"seconds", result.seconds},
                             {"detections", nlohmann::json::array()}};
  for (const Detection& detection : result.detections) {
    document["detections"].push_back({{"pose", poseNumbers(detection.T_C_O)},
                                      {"score", detection.score},
                                      {"visible_fraction", detection.visible_fraction}});
    if (options.depth.file.empty()) continue;
    document["detections"].back()["depth"] = depthJson(detection.depth);
  }
  return document;
}

void printResult(const nlohmann::json& result) {
  std::printf("%zu found in %.2f s\n", result["detections"].size(),
              result["seconds"].get<double>());
  for (const nlohmann::json& detection : result["detections"]) {
    std::printf("score %.2f, pose (x y z qx qy qz qw):", detection["score"].get<double>());
    for (double number : detection["pose"]) std::printf(" %.6f", number);
    std::printf("\n");
  }
}

/// What is added lies behind what is there.
void addBehind(const Rendering& other, Rendering* front) {
  for (std::size_t i = 0; i < front->alpha.values.size(); ++i) {
    const float left = 1 - front->alpha.values[i];
    for (std::size_t c = 0; c < 3; ++c) {
      front->colour.values[3 * i + c] += left * other.colour.values[3 * i + c];
    }
    front->alpha.values[i] += left * other.alpha.values[i];
  }
}

void drawDetections(const DetectOptions& options, const Object& object,
                    const Observation& observation, const LoadedField& field,
                    std::vector<Detection> detections) {
  std::sort(detections.begin(), detections.end(), [](const Detection& a, const Detection& b) {
    return a.T_C_O.t.norm() < b.T_C_O.t.norm();
  });
  const Camera& camera = observation.camera;
  Rendering all;
  all.colour = Image(camera.width, camera.height, 3);
  all.alpha = Image(camera.width, camera.height, 1);
  for (const Detection& detection : detections) {
    addBehind(
        field.render({camera, ObjectInside::frame(object).cameraInModel(detection.T_C_O)}, {}, {}),
        &all);
  }
  writePng(drawOverlay(observation.image, all, 0.7), options.overlay);
}

void detect(const DetectOptions& options, const CancellationToken& cancellation) {
  if (!options.overlay.empty()) requireWritable(options.overlay);
  const Object object = loadObject(options.model);
  const Image8 photo = readImage(options.image);
  RefineCase input = caseOfPhoto(photo, options.mask.empty() ? Image8() : readMask(options.mask),
                                 cameraFromNumbers(options.intrinsics, photo.width, photo.height),
                                 Distortion{options.distortion});
  if (!options.depth.file.empty()) {
    options.depth.giveTo(options.depth.read(ObjectInside::field(object)->metadata), &input);
  }
  Observation observation = observationOf(input, {});
  if (!options.box.empty()) {
    observation.boxes = {{options.box[0], options.box[1], options.box[2], options.box[3]}};
  }
  DetectionHint hint;
  if (options.distance > 0) hint.distance = options.distance;
  DetectorOptions detector_options = options.detector;
  detector_options.landmarks_path =
      options.landmarks.empty() ? landmarksBeside(options.model) : options.landmarks;

  const std::shared_ptr<Backend> backend = options.backend.make();
  Detector detector(backend, object, detector_options, cancellation);
  const DetectionResult result = detector.detect(observation, hint, cancellation);
  if (!options.overlay.empty()) {
    drawDetections(options, object, observation, *backend->load(ObjectInside::field(object)),
                   result.detections);
  }
  const nlohmann::json document = resultJson(options, object, result);
  if (options.json) {
    printJson(document);
  } else {
    printResult(document);
  }
  if (result.detections.empty()) throw std::runtime_error("not found: " + result.message);
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  return nerf_pose_refiner::runTool(argc, argv, nerf_pose_refiner::declare,
                                    nerf_pose_refiner::detect);
}
