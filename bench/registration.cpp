// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>

#include "nerf_pose_refiner/field/model_file.h"
#include "nerf_pose_refiner/image/colour.h"
#include "nerf_pose_refiner/image/resample.h"
#include "nerf_pose_refiner/register/registrar.h"
#include "nerf_pose_refiner/tasks/parallel.h"
#include "work_report.h"

// Registers an object and measures: time and work against the machine's floor, quality over test
// views, what the occupancy grid leaves out, and memory.

namespace nerf_pose_refiner {
namespace {

double secondsSince(std::chrono::steady_clock::time_point start) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double rootMeanSquare(const Image& a, const Image& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) {
    sum += (a.values[i] - b.values[i]) * (a.values[i] - b.values[i]);
  }
  return std::sqrt(sum / static_cast<double>(a.values.size()));
}

Camera cameraOf(const PosedView& view, int width) {
  return width > 0 ? view.camera.scaled(static_cast<double>(width) / view.camera.width)
                   : view.camera;
}

struct Options {
  std::string dataset, test, model, instruction_set = "auto";
  int size = 0, threads = 0;
  bool compare_occupancy = false;
  RegistrationSettings settings;

  DatasetOptions reading() const {
    DatasetOptions reading;
    reading.threads = threads;
    return reading;
  }
};

void declare(CLI::App* app, Options* options) {
  RegistrationSettings& settings = options->settings;
  settings.held_out = 0;
  app->add_option("dataset", options->dataset, "folder or transforms file of the training views")
      ->required();
  app->add_option("--test", options->test, "transforms file of the test views");
  app->add_option("--size", options->size, "width of the test pictures [px]; 0: as they are");
  app->add_flag("--compare-occupancy", options->compare_occupancy,
                "also render without the occupancy grid");
  app->add_option("--model", options->model, "write the model to this file");
  app->add_option("--profile", settings.profile, "shape of the field");
  app->add_option("--steps", settings.steps, "training steps at most");
  app->add_option("--max-seconds", settings.max_seconds, "of training; 0: no limit");
  app->add_option("--samples-per-step", settings.plan.samples_per_step, "about");
  app->add_option("--learning-rate", settings.plan.learning_rate, "of Adam");
  app->add_option("--held-out", settings.held_out, "training views kept apart");
  app->add_option("--seed", settings.seed, "of all random numbers");
  app->add_option("--threads", options->threads, "0: all cores");
  app->add_option("--instruction-set", options->instruction_set, "auto, baseline or avx2");
}

// How far pictures are from those that are rendered without the occupancy grid, at most.
double worstWithoutOccupancy(Engine* engine, const LoadedField& field, const Dataset& test,
                             int size) {
  RenderOptions all;
  all.use_occupancy = false;
  double worst = 0;
  for (const PosedView& view : test.views) {
    const Camera camera = cameraOf(view, size);
    worst =
        std::max(worst, rootMeanSquare(engine->render(field, camera, view.T_O_C, all, {}).colour,
                                       engine->render(field, camera, view.T_O_C, {}, {}).colour));
  }
  return worst;
}

void measureTestViews(Engine* engine, const Field& field, const Options& options) {
  const Dataset test = loadTransforms(options.test, options.reading());
  const auto loaded = engine->load(std::make_shared<Field>(field));
  const std::size_t table_bytes = field.grid.size() * sizeof(std::uint16_t);
  const Floor floor = measureFloor(threadCount(options.threads), table_bytes);
  double psnr_sum = 0, seconds = 0;
  const Work before = engine->work();
  for (const PosedView& view : test.views) {
    const Camera camera = cameraOf(view, options.size);
    const Image truth = resample(premultiply(*view.rgba).colour, view.camera, camera);
    const auto start = std::chrono::steady_clock::now();
    const Rendering rendering = engine->render(*loaded, camera, view.T_O_C, {}, {});
    seconds += secondsSince(start);
    psnr_sum += psnr(rendering.colour, truth);
  }
  printWork("rendering", engine->work() - before, seconds, floor);
  std::printf("test views          %zu of %d px width\n", test.views.size(),
              cameraOf(test.views.front(), options.size).width);
  std::printf("PSNR                %.2f dB (mean over views, sRGB values on black)\n",
              psnr_sum / static_cast<double>(test.views.size()));
  if (options.compare_occupancy) {
    std::printf("occupancy grid      %.2e RMS at most against rendering without it\n",
                worstWithoutOccupancy(engine, *loaded, test, options.size));
  }
}

void run(const Options& options) {
  const Dataset data = loadTransforms(options.dataset, options.reading());
  const auto engine = makeCpuEngine(options.threads, options.instruction_set);
  std::printf("engine              %s\n", engine->describe().c_str());
  RegistrationSettings settings = options.settings;
  settings.threads = options.threads;
  double training_s = 0;
  Work training;
  const auto watch = [&](const RegistrationProgress& progress) {
    if (progress.stage == "quality") return;  // "occupancy" is reported when training ends
    training_s = progress.seconds;
    training = engine->work();
  };
  const auto start = std::chrono::steady_clock::now();
  const Field field = registerObject(engine.get(), data, settings, watch, {});
  std::printf("registration        %.1f s in all, %.1f s of training, %llu steps\n",
              secondsSince(start), training_s,
              static_cast<unsigned long long>(field.metadata.training_steps));
  std::printf("object              diameter %.4f, profile %s\n", field.metadata.diameter,
              field.config.profile.c_str());
  if (!options.model.empty()) saveModel(field, options.model);

  const std::size_t table_bytes = field.grid.size() * sizeof(std::uint16_t);
  const Floor floor = measureFloor(threadCount(options.threads), table_bytes);
  printFloor(floor, table_bytes);
  printWorkHead();
  printWork("training", training, training_s, floor);
  if (!options.test.empty()) measureTestViews(engine.get(), field, options);
  std::printf("peak memory         %.0f MiB\n", peakMemory_MiB());
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  nerf_pose_refiner::Options options;
  CLI::App app(
      "Registers an object and measures time, work, quality and memory.\n"
      "Example: registration chair/transforms_train.json --test chair/transforms_test.json "
      "--size 400 --max-seconds 240");
  nerf_pose_refiner::declare(&app, &options);
  CLI11_PARSE(app, argc, argv);
  try {
    nerf_pose_refiner::run(options);
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "registration: %s\n", e.what());
    return 1;
  }
}
