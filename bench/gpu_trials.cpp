// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "nerf_pose_refiner/dataset/dataset.h"
#include "nerf_pose_refiner/engine/make_engine.h"
#include "nerf_pose_refiner/evaluate/pose_error.h"
#include "nerf_pose_refiner/evaluate/start.h"
#include "nerf_pose_refiner/field/model_file.h"
#include "nerf_pose_refiner/image/colour.h"
#include "nerf_pose_refiner/refine/refiner.h"

// Trials of both methods on a chosen engine: how often, how exactly, how long. Starts are those of
// Lin et al.: turned by up to 15 degrees about each axis, moved by up to 0.25 units.

namespace nerf_pose_refiner {
namespace {

constexpr double kDegree = 3.14159265358979323846 / 180;

struct Options {
  std::string model, dataset, backend = "auto", preset = "align", background = "white";
  int trials = 25, frames = 0;
  double frame_deg = 2, frame_share = 0.02;
  std::uint64_t seed = 1;
};

struct Result {
  double deg, offset, seconds, samples;
};

double quantile(std::vector<double> values, double share) {
  std::sort(values.begin(), values.end());
  const double last = static_cast<double>(values.size()) - 1;
  return values[static_cast<std::size_t>(std::lround(share * last))];
}

template <typename Value>
std::vector<double> all(const std::vector<Result>& results, const Value& value) {
  std::vector<double> values;
  for (const Result& r : results) values.push_back(value(r));
  return values;
}

Observation observationOf(const PosedView& view, const std::string& background) {
  const PremultipliedImage picture = premultiply(*view.rgba);
  Observation observation;
  observation.camera = view.camera;
  if (background == "alpha") {
    observation.background = Background::kKnownAlpha;
    observation.image = picture.colour;
    observation.alpha = picture.alpha;
  } else {
    observation.background = Background::kKnownColour;
    observation.background_colour.setOnes();
    observation.image = composite(picture, {1, 1, 1});
  }
  return observation;
}

void printTable(const char* name, const std::vector<Result>& results, double far_deg,
                double far_offset) {
  const auto near = std::count_if(results.begin(), results.end(), [&](const Result& r) {
    return r.deg < far_deg && r.offset < far_offset;
  });
  const auto deg = all(results, [](const Result& r) { return r.deg; });
  const auto offset = all(results, [](const Result& r) { return r.offset; });
  const auto seconds = all(results, [](const Result& r) { return r.seconds; });
  const auto samples = all(results, [](const Result& r) { return r.samples; });
  std::printf(
      "%-8s %d of %zu within %.1f deg and %.3f; median %.3f deg, %.4f; worst %.2f deg, %.4f; "
      "%.2f ms median, %.2f ms p99; %.1f M samples\n",
      name, static_cast<int>(near), results.size(), far_deg, far_offset, quantile(deg, 0.5),
      quantile(offset, 0.5), quantile(deg, 1), quantile(offset, 1), 1e3 * quantile(seconds, 0.5),
      1e3 * quantile(seconds, 0.99), 1e-6 * quantile(samples, 0.5));
  std::fflush(stdout);
}

void runTrials(const Options& options, const std::shared_ptr<Engine>& engine,
               const LoadedField& field, const Dataset& data) {
  const FieldMetadata& object = field.field().metadata;
  RefinerSettings settings = RefinerSettings::named(options.preset);
  settings.seed = options.seed;
  settings.inversion.unit = 1;
  Refiner refiner(engine, settings);
  const StartSpread spread = {15 * kDegree, 0.25, false};
  std::vector<Result> results;
  for (int i = 0; i < options.trials; ++i) {
    const PosedView& view = data.views[static_cast<std::size_t>(i) % data.views.size()];
    const Observation observation = observationOf(view, options.background);
    Prior prior;
    prior.T_O_C = perturbedStart(view.T_O_C, spread, object.centre, options.seed,
                                 static_cast<std::uint64_t>(i));
    prior.rotation_rad = 15 * kDegree;
    prior.translation = 0.3 / object.diameter;
    prior.rotate_about_object = false;
    if (i == 0) refiner.refine(field, observation, prior);  // warms up
    const Refinement found = refiner.refine(field, observation, prior);
    const PoseError error = poseError(found.T_O_C, view.T_O_C, object.centre, view.camera);
    results.push_back({error.rotation_rad / kDegree, error.camera_offset, found.seconds,
                       static_cast<double>(found.work.samples)});
    if (i == 0) {
      for (const TraceEntry& t : found.trace) {
        std::printf("    %-8s %2d live, %.2f ms, %.1f M samples\n", t.stage.c_str(), t.live,
                    1e3 * t.seconds, 1e-6 * static_cast<double>(t.work.samples));
      }
    }
  }
  printTable(options.preset.c_str(), results, 5, 0.05);
}

/// A camera on its way around the object, which circles through its pictures; they are rendered,
/// and each pose is found from the last.
void follow(const Options& options, const std::shared_ptr<Engine>& engine,
            const LoadedField& field) {
  constexpr double kTurn = 0.13;  // of the circle, a frame [rad]
  const FieldMetadata& object = field.field().metadata;
  const Camera camera = {640, 480, 700, 700, 319.5, 239.5};
  const double radius = options.frame_share / kTurn;
  Refiner refiner(engine, RefinerSettings::named("track"));
  std::vector<Result> results;
  Pose truth, last;
  for (int i = 0; i <= options.frames; ++i) {
    const double phase = kTurn * i;
    const Eigen::Vector3d axis =
        Eigen::Vector3d(std::sin(phase), 1, 0.5 * std::cos(0.7 * phase)).normalized();
    const Eigen::Vector3d object_C =
        object.diameter * Eigen::Vector3d(radius * std::cos(phase), radius * std::sin(phase), 2.2);
    truth.R = expSO3(Eigen::Vector3d(options.frame_deg * kDegree * axis)) * truth.R;
    truth.t = object.centre - truth.R * object_C;
    if (i == 0) {
      last = truth;
      continue;
    }
    const Rendering rendering = engine->render(field, camera, truth, {}, {});
    Observation observation;
    observation.camera = camera;
    observation.background = Background::kKnownColour;
    observation.background_colour.setConstant(0.5f);
    observation.image = composite({rendering.colour, rendering.alpha}, {0.5f, 0.5f, 0.5f});
    Prior prior;
    prior.T_O_C = last;
    prior.rotation_rad = 1.5 * options.frame_deg * kDegree;
    prior.translation = 1.5 * options.frame_share;
    const Refinement found = refiner.refine(field, observation, prior);
    const PoseError error = poseError(found.T_O_C, truth, object.centre, camera);
    results.push_back({error.rotation_rad / kDegree, error.object_offset / object.diameter,
                       found.seconds, static_cast<double>(found.work.samples)});
    last = found.T_O_C;
  }
  printTable("follow", results, 0.3, 0.005);
}

void run(const Options& options) {
  const std::shared_ptr<Engine> engine = makeEngine({options.backend, 0, "auto", 0});
  std::printf("%s\n", engine->describe().c_str());
  const auto field = engine->load(std::make_shared<Field>(loadModel(options.model)));
  if (options.trials > 0) {
    runTrials(options, engine, *field, loadTransforms(options.dataset));
  }
  if (options.frames > 0) follow(options, engine, *field);
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  nerf_pose_refiner::Options options;
  CLI::App app(
      "Trials of pose refinement and following on an engine.\n"
      "Example: gpu_trials chair.safetensors chair/transforms_test.json --frames 300");
  app.add_option("model", options.model, "model file")->required();
  app.add_option("dataset", options.dataset, "transforms file of the views")->required();
  app.add_option("--backend", options.backend, "auto, cpu or cuda")->capture_default_str();
  app.add_option("--preset", options.preset, "of the refiner")->capture_default_str();
  app.add_option("--background", options.background, "white or alpha")
      ->check(CLI::IsMember({"white", "alpha"}))
      ->capture_default_str();
  app.add_option("--trials", options.trials)->capture_default_str();
  app.add_option("--frames", options.frames, "rendered frames to be followed");
  app.add_option("--frame-deg", options.frame_deg, "rotation from frame to frame")
      ->capture_default_str();
  app.add_option("--frame-share", options.frame_share, "motion from frame to frame, in diameters")
      ->capture_default_str();
  app.add_option("--seed", options.seed)->capture_default_str();
  CLI11_PARSE(app, argc, argv);
  try {
    nerf_pose_refiner::run(options);
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "gpu_trials: %s\n", e.what());
    return 1;
  }
}
