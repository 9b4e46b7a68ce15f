// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "backend_floor.h"
#include "concurrency/parallel.h"
#include "concurrency/seconds_since.h"
#include "field/model_file.h"
#include "image/colour.h"
#include "image/resample.h"
#include "registration/registrar.h"
#include "work_report.h"

// Registers an object and measures: time and work against the machine's floor, quality over test
// views, what the occupancy grid leaves out, and memory.

namespace nerf_pose_refiner {
namespace {

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
  std::string dataset, test, model;
  BackendChoice backend = {"cpu", 0, "auto", 0};
  std::vector<int> steps;  ///< one registration each; none: that of the settings
  double until_psnr_db = 0;
  int size = 0;
  bool compare_occupancy = false;
  RegistrationOptions settings;

  DatasetOptions reading() const {
    DatasetOptions reading;
    reading.threads = backend.threads;
    return reading;
  }
};

void declare(CLI::App* app, Options* options) {
  RegistrationOptions& settings = options->settings;
  settings.held_out = 0;
  settings.accept_poor_data = true;  // a few steps are measured, too
  app->add_option("dataset", options->dataset, "folder or transforms file of the training views")
      ->required();
  app->add_option("--test", options->test, "transforms file of the test views");
  app->add_option("--size", options->size, "width of the test images [px]; 0: as they are");
  app->add_flag("--compare-occupancy", options->compare_occupancy,
                "also render without the occupancy grid");
  app->add_option("--model", options->model, "write the model to this file");
  app->add_option("--profile", settings.profile, "shape of the field");
  app->add_option("--steps", options->steps, "training steps at most; one registration for each");
  app->add_option("--until-psnr", options->until_psnr_db,
                  "no further registration once the test views are shown so well [dB]");
  app->add_option("--max-seconds", settings.max_seconds, "of training; 0: no limit");
  app->add_option("--samples-per-step", settings.samples_per_step, "about");
  app->add_option("--learning-rate", settings.learning_rate, "of Adam");
  app->add_option("--held-out", settings.held_out, "training views kept apart");
  app->add_option("--seed", settings.seed, "of all random numbers");
  app->add_option("--backend", options->backend.backend, "auto, cpu or cuda");
  app->add_option("--device", options->backend.device, "number of the GPU");
  app->add_option("--threads", options->backend.threads, "0: all cores");
  app->add_option("--instruction-set", options->backend.instruction_set, "auto, baseline or avx2");
}

// How far images are from those that are rendered without the occupancy grid, at most.
double worstWithoutOccupancy(const LoadedField& field, const Dataset& test, int size) {
  RenderOptions all;
  all.use_occupancy = false;
  double worst = 0;
  for (const PosedView& view : test.views) {
    const Camera camera = cameraOf(view, size);
    worst = std::max(worst, rootMeanSquare(field.render({camera, view.T_O_C}, all, {}).colour,
                                           field.render({camera, view.T_O_C}, {}, {}).colour));
  }
  return worst;
}

/// @return mean PSNR [dB].
double measureTestViews(Backend* backend, const Field& field, const Dataset& test,
                        const Options& options, const Floor& floor) {
  const auto loaded = backend->load(std::make_shared<Field>(field));
  double psnr_sum = 0, seconds = 0;
  const CostCounters before = backend->costs();
  for (const PosedView& view : test.views) {
    const Camera camera = cameraOf(view, options.size);
    const Image truth = resample(premultiply(*view.rgba).colour, view.camera, camera);
    const auto start = std::chrono::steady_clock::now();
    const Rendering rendering = loaded->render({camera, view.T_O_C}, {}, {});
    seconds += secondsSince(start);
    psnr_sum += psnr(rendering.colour, truth);
  }
  printWork("rendering", backend->costs() - before, seconds, floor);
  std::printf("test views          %zu of %d px width\n", test.views.size(),
              cameraOf(test.views.front(), options.size).width);
  const double psnr_db = psnr_sum / static_cast<double>(test.views.size());
  std::printf("PSNR                %.2f dB (mean over views, sRGB values on black)\n", psnr_db);
  if (options.compare_occupancy) {
    std::printf("occupancy grid      %.2e RMS at most against rendering without it\n",
                worstWithoutOccupancy(*loaded, test, options.size));
  }
  return psnr_db;
}

/// One registration. @return PSNR of the test views; 0 if there are none.
double registerOnce(Backend* backend, const Dataset& data, const Dataset& test,
                    const Options& options, const RegistrationOptions& settings) {
  double training_s = 0;
  CostCounters training;
  const CostCounters before = backend->costs();
  const auto watch = [&](const RegistrationProgress& progress) {
    if (progress.stage == "quality") return;  // "occupancy" is reported when training ends
    training_s = progress.seconds;
    training = backend->costs() - before;
  };
  const auto start = std::chrono::steady_clock::now();
  const Field field = learnField(backend, data, settings, watch, {});
  const double steps = static_cast<double>(field.metadata.training_steps);
  std::printf(
      "registration        %.2f s in all, %.2f s of training, %.0f steps of about %d "
      "samples: %.3f G a second\n",
      secondsSince(start), training_s, steps, settings.samples_per_step,
      1e-9 * steps * settings.samples_per_step / training_s);
  std::printf("object              diameter %.4f, profile %s\n", field.metadata.diameter,
              field.config.profile.c_str());
  if (!options.model.empty()) saveModel(field, options.model);

  const std::size_t table_bytes = field.grid.size() * sizeof(std::uint16_t);
  const Floor floor =
      measureBackendFloor(backend->info(), threadCount(options.backend.threads), table_bytes);
  printFloor(floor, table_bytes);
  printWorkHead();
  printWork("training", training, training_s, floor);
  return test.views.empty() ? 0 : measureTestViews(backend, field, test, options, floor);
}

void run(const Options& options) {
  const Dataset data = loadDataset(options.dataset, options.reading());
  Dataset test;
  if (!options.test.empty()) test = loadDataset(options.test, options.reading());
  const double context_MiB = deviceMemory_MiB();
  const auto backend = makeBackend(options.backend);
  std::printf("engine              %s\n", backend->info().description.c_str());
  RegistrationOptions settings = options.settings;
  settings.threads = options.backend.threads;
  std::vector<int> steps = options.steps;
  if (steps.empty()) steps.push_back(settings.steps);
  for (const int most : steps) {
    settings.steps = most;
    const double psnr_db = registerOnce(backend.get(), data, test, options, settings);
    if (options.until_psnr_db > 0 && psnr_db >= options.until_psnr_db) {
      std::printf("reached             %.2f dB with %d steps\n", options.until_psnr_db, most);
      break;
    }
  }
  std::printf("peak memory         %.0f MiB", peakMemory_MiB());
  if (backend->info().memory_bytes > 0) {
    std::printf(", on the device %.0f MiB beside a context of %.0f",
                deviceMemory_MiB() - context_MiB, context_MiB);
  }
  std::printf("\n");
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
