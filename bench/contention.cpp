// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "backend/backend.h"
#include "concurrency/seconds_since.h"
#include "field/model_file.h"
#include "image/colour.h"
#include "nerf_pose_refiner/pose.h"
#include "registration/registrar.h"
#include "runtime/backend_pool.h"

// What refiners of one process cost each other: tracking alone, beside a second tracked object, and
// beside a training. Images come without a pause, which is the worst case.

namespace nerf_pose_refiner {
namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  std::string model, views, photos;
  int frames = 100, threads = 0;
};

/// Percentiles of latencies [s].
struct Latency {
  double median = 0, p95 = 0;
  explicit Latency(std::vector<double> seconds) {
    std::sort(seconds.begin(), seconds.end());
    median = seconds[seconds.size() / 2];
    p95 = seconds[seconds.size() * 95 / 100];
  }
};

/// A grey wall behind the object, which the refiner knows nothing of.
Observation observe(const PosedView& view) {
  Observation observation;
  observation.image = composite(premultiply(*view.rgba), {0.5f, 0.5f, 0.5f});
  observation.camera = view.camera;
  return observation;
}

class Bench {
 public:
  explicit Bench(const Options& options)
      : options_(options),
        field_(std::make_shared<Field>(loadModel(options.model))),
        views_(loadDataset(options.views).views) {
    choice_.backend = "cpu";
    choice_.threads = options.threads;
    for (const PosedView& view : views_) observations_.push_back(observe(view));
  }

  void run() {
    track(3, nullptr);  // warms up
    const Latency alone(track(options_.frames, nullptr));
    print("one object", alone, alone);
    print("one of two objects", twoObjects(), alone);
    print("one object beside a training", besideATraining(), alone);
    std::printf("training: %.1f steps/s alone, %.1f beside tracking\n", trainAlone(),
                steps_beside_);
  }

 private:
  static void print(const char* what, const Latency& latency, const Latency& alone) {
    std::printf("%-30s median %.1f ms (%.2f x), p95 %.1f ms (%.2f x)\n", what, 1e3 * latency.median,
                latency.median / alone.median, 1e3 * latency.p95, latency.p95 / alone.p95);
  }

  /// Tracks from starts that are 2 degrees and 2 % off. @param stop ends it early; may be null.
  std::vector<double> track(int frames, const std::atomic<bool>* stop) {
    RefinerSearch search([this] { return backends_.searchProcessor(choice_); },
                         RefinerSettings::named("align"), RefinerSettings::named("track"));
    search.use(field_);
    std::vector<double> seconds;
    for (int i = 0; i < frames && !(stop != nullptr && *stop); ++i) {
      const std::size_t v = static_cast<std::size_t>(i) % views_.size();
      Prior prior;
      prior.rotation_rad = 5 * M_PI / 180;  // the node's defaults while it tracks
      prior.translation = 0.05;
      prior.T_O_C = views_[v].T_O_C;
      prior.T_O_C.R = expSO3(Eigen::Vector3d(0.02, -0.02, 0.02)) * prior.T_O_C.R;
      prior.T_O_C.t.x() += 0.02 * field_->metadata.diameter;
      const Clock::time_point start = Clock::now();
      search.search({observations_[v], prior, /*tracked=*/true}, CancellationToken());
      seconds.push_back(secondsSince(start));
    }
    return seconds;
  }

  Latency twoObjects() {
    std::atomic<bool> stop{false};
    std::thread other([&] { track(1 << 30, &stop); });
    const Latency latency(track(options_.frames, nullptr));
    stop = true;
    other.join();
    return latency;
  }

  /// Trains until it is stopped. @return steps a second.
  double train(const CancellationToken& token, std::atomic<int>* steps) {
    RegistrationOptions settings;
    settings.steps = 1 << 30;
    settings.threads = options_.threads;
    const ProcessorSchedule::Training training(backends_.scheduleOf(choice_).get(), token);
    const std::unique_ptr<Backend> backend = makeBackend(choice_);
    Clock::time_point start;
    try {
      learnField(
          backend.get(), loadDataset(options_.photos, {}, token), settings,
          [&](const RegistrationProgress& progress) {
            if (progress.step <= 1) start = Clock::now();
            *steps = progress.step;
          },
          token);
    } catch (const Cancelled&) {
    }
    return *steps / secondsSince(start);
  }

  Latency besideATraining() {
    const CancellationToken token;
    std::atomic<int> steps{0};
    std::thread other([&] { steps_beside_ = train(token, &steps); });
    while (steps == 0) std::this_thread::yield();
    const Latency latency(track(options_.frames, nullptr));
    token.requestCancel();
    other.join();
    return latency;
  }

  double trainAlone() {
    const CancellationToken token;
    std::atomic<int> steps{0};
    double rate = 0;
    std::thread other([&] { rate = train(token, &steps); });
    while (steps == 0) std::this_thread::yield();
    std::this_thread::sleep_for(std::chrono::seconds(10));
    token.requestCancel();
    other.join();
    return rate;
  }

  Options options_;
  BackendPool backends_;
  BackendChoice choice_;
  std::shared_ptr<const Field> field_;
  std::vector<PosedView> views_;
  std::vector<Observation> observations_;
  double steps_beside_ = 0;
};

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) {
  nerf_pose_refiner::Options options;
  CLI::App app("What refiners of one process cost each other.");
  app.add_option("model", options.model, "of the object that is tracked")->required();
  app.add_option("views", options.views, "folder or transforms file of views to track it in")
      ->required();
  app.add_option("photos", options.photos, "folder or transforms file to train another one from")
      ->required();
  app.add_option("--frames", options.frames, "images of each measurement");
  app.add_option("--threads", options.threads, "of each backend; 0: all cores");
  CLI11_PARSE(app, argc, argv);
  try {
    nerf_pose_refiner::Bench(options).run();
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s\n", e.what());
    return 1;
  }
  return 0;
}
