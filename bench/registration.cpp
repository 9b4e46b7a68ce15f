// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>

#include "nerf_pose_refiner/field/model_file.h"
#include "nerf_pose_refiner/image/colour.h"
#include "nerf_pose_refiner/image/resample.h"
#include "nerf_pose_refiner/register/registrar.h"

// Registers an object and measures: time, quality over test views, and what the occupancy grid
// leaves out.

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

void measureTestViews(Engine* engine, const Field& field, const std::string& path, int size,
                      bool compare_without_occupancy) {
  const Dataset test = loadTransforms(path);
  const auto loaded = engine->load(std::make_shared<Field>(field));
  double psnr_sum = 0, worst = 0, seconds = 0;
  const Work before = engine->work();
  Work without;
  for (const PosedView& view : test.views) {
    const double scale = size > 0 ? static_cast<double>(size) / view.camera.width : 1.0;
    const Camera camera = view.camera.scaled(scale);
    const Image truth = resample(premultiply(*view.rgba).colour, view.camera, camera);
    const auto start = std::chrono::steady_clock::now();
    const Rendering rendering = engine->render(*loaded, camera, view.T_O_C, {}, {});
    seconds += secondsSince(start);
    psnr_sum += psnr(rendering.colour, truth);
    if (!compare_without_occupancy) continue;
    const Work begin = engine->work();
    RenderOptions all;
    all.use_occupancy = false;
    worst =
        std::max(worst, rootMeanSquare(engine->render(*loaded, camera, view.T_O_C, all, {}).colour,
                                       rendering.colour));
    without += engine->work() - begin;
  }
  const Work work = engine->work() - before - without;
  std::printf("test views          %zu of %d px width\n", test.views.size(),
              size > 0 ? size : test.views.front().camera.width);
  std::printf("PSNR                %.2f dB (mean over views, sRGB values on black)\n",
              psnr_sum / static_cast<double>(test.views.size()));
  if (compare_without_occupancy) {
    std::printf("occupancy grid      %.2e RMS at most against rendering without it\n", worst);
  }
  std::printf("rendering           %.1f million samples, %.1f million with colour, %.2f s\n",
              1e-6 * static_cast<double>(work.samples),
              1e-6 * static_cast<double>(work.colour_samples), seconds);
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  using namespace nerf_pose_refiner;
  CLI::App app(
      "Registers an object and measures time and quality.\n"
      "Example: registration chair/transforms_train.json --test chair/transforms_test.json "
      "--size 400 --max-seconds 240");
  std::string dataset, test, model, instruction_set = "auto";
  int size = 0, threads = 0;
  bool occupancy = false;
  RegistrationSettings settings;
  settings.held_out = 0;
  app.add_option("dataset", dataset, "folder or transforms file of the training views")->required();
  app.add_option("--test", test, "transforms file of the test views");
  app.add_option("--size", size, "width of the test pictures [px]; 0: as they are");
  app.add_flag("--compare-occupancy", occupancy, "also render without the occupancy grid");
  app.add_option("--model", model, "write the model to this file");
  app.add_option("--profile", settings.profile, "shape of the field");
  app.add_option("--steps", settings.steps, "training steps at most");
  app.add_option("--max-seconds", settings.max_seconds, "of training; 0: no limit");
  app.add_option("--samples-per-step", settings.plan.samples_per_step, "about");
  app.add_option("--learning-rate", settings.plan.learning_rate, "of Adam");
  app.add_option("--held-out", settings.held_out, "training views kept apart");
  app.add_option("--seed", settings.seed, "of all random numbers");
  app.add_option("--threads", threads, "0: all cores");
  app.add_option("--instruction-set", instruction_set, "auto, baseline or avx2");
  CLI11_PARSE(app, argc, argv);
  try {
    const Dataset data = loadTransforms(dataset);
    const auto engine = makeCpuEngine(threads, instruction_set);
    std::printf("engine              %s\n", engine->describe().c_str());
    const auto start = std::chrono::steady_clock::now();
    double training_s = 0;
    const Field field = registerObject(engine.get(), data, settings,
                                       [&](const RegistrationProgress& progress) {
                                         if (progress.stage == "training")
                                           training_s = progress.seconds;
                                       },
                                       {});
    std::printf("registration        %.1f s in all, %.1f s of training, %llu steps\n",
                secondsSince(start), training_s,
                static_cast<unsigned long long>(field.metadata.training_steps));
    std::printf("object              diameter %.4f, profile %s\n", field.metadata.diameter,
                field.config.profile.c_str());
    if (!model.empty()) saveModel(field, model);
    if (!test.empty()) measureTestViews(engine.get(), field, test, size, occupancy);
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "registration: %s\n", e.what());
    return 1;
  }
}
