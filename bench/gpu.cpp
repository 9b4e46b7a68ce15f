// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <string>
#include <vector>

#include "backend/common/ray_march.h"
#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "backend/training.h"
#include "dataset/dataset.h"
#include "device_floor.h"
#include "field/model_file.h"
#include "image/colour.h"
#include "math/half.h"
#include "math/random.h"

// Rates of the CUDA backend's kernels against the device's gather rate, measured in the same run.

namespace nerf_pose_refiner {
namespace {

struct Samples {
  const char* order;  ///< in which they come
  std::vector<float> positions, directions;
};

double medianOf(std::vector<double> values) {
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

/// Occupied samples of the rays of a view, ray after ray: n of them, from rays all over the
/// image.
Samples alongRays(const Field& field, const PosedView& view, std::size_t n) {
  const OccupancyMask mask(field.occupancy);
  const double side = field.cubeSide();
  const Eigen::Vector3d corner = field.cubeCentre() - Eigen::Vector3d::Constant(0.5 * side);
  MarchSpace space;
  for (int a = 0; a < 3; ++a) {
    space.box_min[a] = static_cast<float>((field.box.min[a] - corner[a]) / side);
    space.box_max[a] = static_cast<float>((field.box.max[a] - corner[a]) / side);
  }
  space.near = 0;
  space.step = field.config.step;
  space.cone_angle = field.config.cone_angle;
  space.mask = &mask;
  Samples samples = {"rays", {}, {}};
  const Eigen::Vector3d origin = (view.T_O_C.t - corner) / side;
  const int pixels = view.camera.width * view.camera.height;
  for (int start = 0; start < 7; ++start) {
    for (int i = start; i < pixels; i += 7) {
      const int x = i % view.camera.width, y = i / view.camera.width;
      const Eigen::Vector3f o = origin.cast<float>();
      const Eigen::Vector3f d =
          (view.T_O_C.R * view.camera.direction(x, y)).normalized().cast<float>();
      RayMarcher marcher(o.data(), d.data(), space);
      RaySample sample;
      while (marcher.next(&sample)) {
        for (int a = 0; a < 3; ++a) {
          samples.positions.push_back(o[a] + sample.t * d[a]);
          samples.directions.push_back(d[a]);
        }
        if (samples.positions.size() == 3 * n) return samples;
      }
    }
  }
  return samples;
}

Samples atRandom(std::size_t n) {
  Samples samples = {"random", {}, {}};
  for (std::size_t i = 0; i < n; ++i) {
    Eigen::Vector3f d;
    for (std::size_t a = 0; a < 3; ++a) {
      samples.positions.push_back(randomUniform(1, i, a));
      d[static_cast<Eigen::Index>(a)] = randomUniform(2, i, a) - 0.5f;
    }
    d.normalize();
    samples.directions.insert(samples.directions.end(), d.data(), d.data() + 3);
  }
  return samples;
}

/// Another shape in the place of a model: its box and occupancy, parameters drawn.
Field reshaped(const Field& model, const FieldConfig& shape) {
  Field field = model;
  field.config = shape;
  field.config.occupancy_resolution = model.config.occupancy_resolution;
  const GridLevel last = gridLevels(field.config).back();
  field.grid.resize((std::size_t{last.offset} + last.entries) *
                    static_cast<std::size_t>(field.config.features));
  std::uint64_t drawn = 0;
  for (std::uint16_t& v : field.grid) v = floatToHalf(randomUniform(3, 0, drawn++) - 0.5f);
  field.density_weights.assign(densityWeightCount(field.config), 0);
  field.colour_weights.assign(colourWeightCount(field.config), 0);
  for (float& v : field.density_weights) v = 0.3f * (randomUniform(3, 1, drawn++) - 0.5f);
  for (float& v : field.colour_weights) v = 0.3f * (randomUniform(3, 2, drawn++) - 0.5f);
  return field;
}

void rateRow(const std::string& name, const Field& field, const Samples& samples,
             bool with_gradient, double gathers_per_s) {
  const double n = static_cast<double>(samples.positions.size()) / 3;
  const double seconds =
      medianOf(timeEvaluations(field, samples.positions, samples.directions, with_gradient, 15));
  const double floor = 8.0 * field.config.levels * n / gathers_per_s;
  std::printf("%-10s %-8s %-8s 2^%.0f samples: %7.1f us, %6.2f G samples/s; floor %7.1f us, %.2f\n",
              name.c_str(), samples.order, with_gradient ? "back" : "forward", std::log2(n),
              1e6 * seconds, 1e-9 * n / seconds, 1e6 * floor, floor / seconds);
  std::fflush(stdout);
}

/// Steps of training on the views, by the host's clock, to the end of the last.
/// @param model whose shape, box and occupied region the trained field has.
void trainingRow(Backend* backend, const std::string& name, const Field& model,
                 const std::vector<PosedView>& views, double gathers_per_s) {
  constexpr int kSamples = 1 << 18, kWarmUp = 512, kSteps = 512;  // waits come every 16 steps
  std::vector<TrainingView> learned;
  for (const PosedView& view : views) learned.push_back({view.rgba, view.camera, view.T_O_C});
  TrainingPlan plan;
  plan.samples_per_step = kSamples;
  plan.region = model.occupancy;
  const auto trainer = backend->makeTrainer(model.config, model.box, learned, plan);
  for (int i = 0; i < kWarmUp; ++i) trainer->step(0);
  const CostCounters before = backend->costs();
  const auto start = std::chrono::steady_clock::now();
  for (int i = 0; i < kSteps; ++i) trainer->step(0);
  const double seconds =
      std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() / kSteps;
  const double floor = (backend->costs() - before).gathers / kSteps / gathers_per_s;
  std::printf(
      "%-10s training step of about 2^18 samples: %7.1f us, %6.3f G samples/s; floor %7.1f "
      "us, %.2f; memory in use %zu MiB\n",
      name.c_str(), 1e6 * seconds, 1e-9 * kSamples / seconds, 1e6 * floor, floor / seconds,
      deviceMemoryUsed() >> 20);
  std::fflush(stdout);
}

FieldConfig wideFeatures() {
  FieldConfig config;  // few levels of many features: few gathers
  config.levels = 4;
  config.features = 8;
  config.log2_table_size = 19;
  config.base_resolution = 32;
  return config;
}

void run(const std::string& path, const std::string& dataset) {
  using Clock = std::chrono::steady_clock;
  const std::unique_ptr<Backend> backend = makeCudaBackend();
  const Field model = loadModel(path);
  const Dataset views = loadDataset(dataset);
  const PosedView& view = views.views.front();
  std::printf("%s; memory in use %zu MiB\n", backend->info().description.c_str(),
              deviceMemoryUsed() >> 20);
  const DeviceFloor floor = measureDeviceFloor(model.grid.size() * 2);
  std::printf("products of halves %.0f TFLOP/s; ", 1e-12 * floor.flops_per_s);
  std::printf("copies %.2f TB/s; gathers of 8 bytes from %.0f MiB: %.0f billion/s\n",
              1e-12 * floor.bytes_per_s, static_cast<double>(model.grid.size()) * 2 / (1 << 20),
              1e-9 * floor.gathers_per_s);
  const FieldConfig paper = FieldConfig::named("paper");
  for (const std::size_t n : {std::size_t{1} << 18, std::size_t{1} << 20}) {
    const Samples rays = alongRays(model, view, n), points = atRandom(n);
    for (const auto& [name, field] : {std::pair<std::string, Field>{"model", model},
                                      {"paper", reshaped(model, paper)},
                                      {"4 x 8", reshaped(model, wideFeatures())}}) {
      for (const bool back : {false, true}) {
        rateRow(name, field, rays, back, floor.gathers_per_s);
        rateRow(name, field, points, back, floor.gathers_per_s);
      }
    }
  }
  trainingRow(backend.get(), "model", model, views.views, floor.gathers_per_s);
  trainingRow(backend.get(), "paper", reshaped(model, paper), views.views, floor.gathers_per_s);
  const auto start = Clock::now();
  const auto loaded = backend->load(std::make_shared<Field>(loadModel(path)));
  std::printf("file to device: %.1f ms\n",
              1e3 * std::chrono::duration<double>(Clock::now() - start).count());
  double psnr_sum = 0;
  std::vector<double> device, host;
  for (const PosedView& v : views.views) {
    device.push_back(medianOf(timeRenderings(model, {v.camera, v.T_O_C}, 5)));
    const auto begin = Clock::now();
    const Rendering rendering = loaded->render({v.camera, v.T_O_C}, {}, {});
    host.push_back(std::chrono::duration<double>(Clock::now() - begin).count());
    psnr_sum += psnr(rendering.colour, premultiply(*v.rgba).colour);
  }
  std::printf("rendering %d x %d: %.2f ms on the device, %.1f ms to the host; %.2f dB on black\n",
              view.camera.width, view.camera.height, 1e3 * medianOf(device), 1e3 * medianOf(host),
              psnr_sum / static_cast<double>(views.views.size()));
  std::printf("memory in use %zu MiB\n", deviceMemoryUsed() >> 20);
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  CLI::App app(
      "Rates of the CUDA backend.\nExample: gpu chair.safetensors chair/transforms_test.json");
  std::string model, dataset;
  app.add_option("model", model, "model file")->required();
  app.add_option("dataset", dataset, "transforms file of the views to render")->required();
  CLI11_PARSE(app, argc, argv);
  try {
    nerf_pose_refiner::run(model, dataset);
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "gpu: %s\n", e.what());
    return 1;
  }
}
