// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <chrono>
#include <cstdio>
#include <string>

#include "backend/make_backend.h"
#include "concurrency/parallel.h"
#include "dataset/dataset.h"
#include "field/model_file.h"
#include "image/colour.h"
#include "refinement/field_refiner.h"
#include "work_report.h"

// The rate of rendering and of direct alignment on this machine, against the floor that gathers and
// multiplications set, measured in the same run.

namespace nerf_pose_refiner {
namespace {

template <typename Body>
double timed(const Body& body) {
  const auto start = std::chrono::steady_clock::now();
  body();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void run(Backend* backend, const Field& field, const Dataset& data, int threads, int rounds) {
  const auto loaded = backend->load(std::make_shared<Field>(field));
  const PosedView& view = data.views.front();
  const PremultipliedImage picture = premultiply(*view.rgba);
  Observation observation;
  observation.image = picture.colour;
  observation.alpha = picture.alpha;
  observation.camera = view.camera;
  observation.background = Background::kKnownAlpha;
  Prior prior;
  prior.T_O_C = view.T_O_C;
  FieldRefiner refiner(std::shared_ptr<Backend>(backend, [](Backend*) {}),
                       RefinerSettings::named("align"));

  const std::size_t table_bytes = field.grid.size() * sizeof(std::uint16_t);
  printWorkHead();
  for (int round = 0; round < rounds; ++round) {
    const Floor floor = measureFloor(threads, table_bytes);
    printFloor(floor, table_bytes);
    CostCounters before = backend->costs();
    double seconds = timed([&] {
      for (const PosedView& v : data.views) loaded->render({v.camera, v.T_O_C}, {}, {});
    });
    printWork("rendering", backend->costs() - before, seconds, floor);
    before = backend->costs();
    seconds = timed([&] { refiner.refine(*loaded, observation, prior); });
    printWork("alignment", backend->costs() - before, seconds, floor);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  using namespace nerf_pose_refiner;
  CLI::App app(
      "Rates of rendering and alignment against the machine's floor.\n"
      "Example: throughput chair.safetensors chair/transforms_test.json");
  std::string model, dataset, instruction_set = "auto";
  int threads = 0, rounds = 3;
  app.add_option("model", model, "model file")->required();
  app.add_option("dataset", dataset, "transforms file of the views to render")->required();
  app.add_option("--threads", threads, "0: all cores");
  app.add_option("--rounds", rounds, "repetitions, each with the floor measured again");
  app.add_option("--instruction-set", instruction_set, "auto, baseline or avx2");
  CLI11_PARSE(app, argc, argv);
  try {
    threads = threadCount(threads);
    const auto backend = makeCpuBackend(threads, instruction_set);
    std::printf("%s\n", backend->info().description.c_str());
    DatasetOptions reading;
    reading.threads = threads;
    run(backend.get(), loadModel(model), loadDataset(dataset, reading), threads, rounds);
    std::printf("peak memory %.0f MiB\n", peakMemory_MiB());
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "throughput: %s\n", e.what());
    return 1;
  }
}
