// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <string>
#include <thread>

#include "floor.h"
#include "nerf_pose_refiner/dataset/dataset.h"
#include "nerf_pose_refiner/field/model_file.h"
#include "nerf_pose_refiner/image/colour.h"
#include "nerf_pose_refiner/refine/refiner.h"

// The rate of rendering and of direct alignment on this machine, against the floor that gathers and
// multiplications set, measured in the same run.

namespace nerf_pose_refiner {
namespace {

void printHead() {
  std::printf("%-10s %8s %9s %9s %9s %8s %8s %8s %8s %9s %9s\n", "", "Mrays", "Msamples",
              "Ggathers", "GFLOP", "Msmpl/s", "seconds", "gather s", "FLOP s", "of larger",
              "of sum");
}

// The last columns: the time that the work cannot undercut over the time it took, if gathers and
// operations overlap wholly (the larger of their two times) and if they do not at all (the sum).
void printRow(const char* what, const Work& work, double seconds, const Floor& floor) {
  const double gather_s = work.gathers / floor.gathers_per_s;
  const double flop_s = work.flops / floor.flops_per_s;
  std::printf("%-10s %8.1f %9.1f %9.2f %9.1f %8.2f %8.3f %8.3f %8.3f %9.2f %9.2f\n", what,
              1e-6 * static_cast<double>(work.rays), 1e-6 * static_cast<double>(work.samples),
              1e-9 * work.gathers, 1e-9 * work.flops,
              1e-6 * static_cast<double>(work.samples) / seconds, seconds, gather_s, flop_s,
              std::max(gather_s, flop_s) / seconds, (gather_s + flop_s) / seconds);
}

template <typename Body>
double timed(const Body& body) {
  const auto start = std::chrono::steady_clock::now();
  body();
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

void run(Engine* engine, const Field& field, const Dataset& data, int threads, int rounds) {
  const auto loaded = engine->load(std::make_shared<Field>(field));
  const PosedView& view = data.views.front();
  const PremultipliedImage picture = premultiply(*view.rgba);
  Observation observation;
  observation.image = picture.colour;
  observation.alpha = picture.alpha;
  observation.camera = view.camera;
  observation.background = Background::kKnownAlpha;
  Prior prior;
  prior.T_O_C = view.T_O_C;
  Refiner refiner(std::shared_ptr<Engine>(engine, [](Engine*) {}), RefinerSettings::named("align"));

  printHead();
  for (int round = 0; round < rounds; ++round) {
    const Floor floor = measureFloor(threads, field.grid.size() * sizeof(std::uint16_t));
    std::printf("floor: %.0f GFLOP/s, %.0f million gathers/s of 8 bytes from %.1f MiB\n",
                1e-9 * floor.flops_per_s, 1e-6 * floor.gathers_per_s,
                static_cast<double>(field.grid.size()) * 2 / (1 << 20));
    Work before = engine->work();
    double seconds = timed([&] {
      for (const PosedView& v : data.views) engine->render(*loaded, v.camera, v.T_O_C, {}, {});
    });
    printRow("rendering", engine->work() - before, seconds, floor);
    before = engine->work();
    seconds = timed([&] { refiner.refine(*loaded, observation, prior); });
    printRow("alignment", engine->work() - before, seconds, floor);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  using namespace nerf_pose_refiner;
  CLI::App app(
      "Rates of rendering and alignment against the machine's floor.\n"
      "Example: throughput chair.npr chair/transforms_test.json");
  std::string model, dataset, instruction_set = "auto";
  int threads = 0, rounds = 3;
  app.add_option("model", model, "model file")->required();
  app.add_option("dataset", dataset, "transforms file of the views to render")->required();
  app.add_option("--threads", threads, "0: all cores");
  app.add_option("--rounds", rounds, "repetitions, each with the floor measured anew");
  app.add_option("--instruction-set", instruction_set, "auto, baseline or avx2");
  CLI11_PARSE(app, argc, argv);
  try {
    if (threads == 0) threads = static_cast<int>(std::thread::hardware_concurrency());
    const auto engine = makeCpuEngine(threads, instruction_set);
    std::printf("%s\n", engine->describe().c_str());
    run(engine.get(), loadModel(model), loadTransforms(dataset), threads, rounds);
    return 0;
  } catch (const std::exception& e) {
    std::fprintf(stderr, "throughput: %s\n", e.what());
    return 1;
  }
}
