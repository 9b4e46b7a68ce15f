// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// How long it takes to track several objects in the images of one camera: with one image for all of
// them, which share what is made of it, and with an image for each. Camera and objects stand still;
// the noise of the images differs.

#include <CLI/CLI.hpp>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <iterator>
#include <memory>
#include <random>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "concurrency/seconds_since.h"
#include "evaluation/pose_error.h"
#include "evaluation/statistics.h"
#include "field/object_frame.h"
#include "field/object_metadata.h"
#include "image/colour.h"
#include "math/angle.h"
#include "object_scene.h"
#include "processor_seconds.h"
#include "runtime/backend_pool.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {
namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  std::vector<std::pair<std::string, std::string>> objects;  // model and data
  std::vector<std::string> photos;
  BackendChoice backend = {"cpu", 0, "auto", 0};
  int scenes = 4, images = 40;
  int width = 640, height = 480;
  double noise = 0.01;
};

/// How the objects are tracked in an image.
struct Manner {
  const char* name;
  bool shares;       // one image for all; false: one for each
  bool has_threads;  // for each object one, as nodelets have; false: one after the other
};

constexpr Manner kManners[] = {{"an image for each, one after the other", false, false},
                               {"one image for all, one after the other", true, false},
                               {"an image for each, at once", false, true},
                               {"one image for all, at once", true, true}};

/// What was measured of all objects together.
struct Tally {
  std::vector<double> wall_ms, processor_ms;
  int right = 0, poses = 0;
  std::vector<Pose> found;  // of every object in every image
};

class Benchmark {
 public:
  explicit Benchmark(const Options& options)
      : options_(options), backend_(backends_.searchProcessor(options.backend).backend) {
    std::vector<std::string> data;
    for (const auto& [model, transforms] : options.objects) {
      auto field = std::make_shared<Field>(loadField(model));
      if (!(field->metadata.metres_per_unit > 0)) field->metadata.metres_per_unit = 1;
      fields_.push_back(std::move(field));
      data.push_back(transforms);
    }
    scenes_ = std::make_unique<SceneComposer>(data, options.photos, options.width, options.height);
  }

  void run() {
    Tally tallies[std::size(kManners)];
    for (int scene = 0; scene < options_.scenes; ++scene) {
      const ObjectScene shown = scenes_->compose(static_cast<std::size_t>(scene));
      for (std::size_t i = 0; i < std::size(kManners); ++i) {
        track(shown, kManners[i], &tallies[i]);
      }
    }
    for (std::size_t i = 0; i < std::size(kManners); ++i) print(kManners[i], tallies[i]);
    for (const Tally& tally : tallies) {
      if (!areEqual(tally.found, tallies[0].found)) {
        throw std::runtime_error("the poses depend on how the objects are tracked");
      }
    }
    std::printf("the same poses in all four manners\n");
  }

 private:
  using Trackers = std::vector<std::unique_ptr<ObjectTracker>>;

  /// Told the true poses, so that all are tracked from the first image on.
  Trackers trackersOf(const ObjectScene& scene) const {
    Trackers trackers;
    for (std::size_t i = 0; i < fields_.size(); ++i) {
      TrackerSettings settings;
      settings.tracking.refiner.keyframes.real_time = false;
      trackers.push_back(std::make_unique<ObjectTracker>(backend_, fields_[i], settings));
      const ObjectFrame frame = ObjectFrame::inMetres(fields_[i]->metadata);
      trackers.back()->offer({frame.objectInCamera(scene.T_O_C[i]), "camera", 0, false, {}});
    }
    return trackers;
  }

  Image8 imageOf(const ObjectScene& scene, int number) const {
    std::mt19937 random(static_cast<unsigned>(number));
    std::normal_distribution<float> noise(0, static_cast<float>(options_.noise));
    Image image = scene.observation.image;
    for (float& value : image.values) value += noise(random);
    return toBytes(image);
  }

  void track(const ObjectScene& scene, const Manner& manner, Tally* tally) const {
    constexpr std::int64_t kPeriod_ns = 33333333;
    constexpr int kFirst = 5;  // are not measured: keyframes are made
    const Trackers trackers = trackersOf(scene);
    for (int i = 0; i < options_.images; ++i) {
      const Image8 image = imageOf(scene, i);
      const auto seen = [&] {
        return observe(viewOf(image), PixelFormat::kRgb, scene.observation.camera, {});
      };
      const Observation for_all = seen();
      std::vector<TrackOutcome> outcomes(trackers.size());
      const auto follow = [&](std::size_t k) {
        outcomes[k] = trackers[k]->track({{"camera", (i + 1) * kPeriod_ns},
                                          [&](bool) { return manner.shares ? for_all : seen(); }});
      };
      const auto begin = Clock::now();
      const double processor = processorSeconds();
      if (manner.has_threads) {
        std::vector<std::thread> threads;
        for (std::size_t k = 0; k < trackers.size(); ++k) threads.emplace_back(follow, k);
        for (std::thread& thread : threads) thread.join();
      } else {
        for (std::size_t k = 0; k < trackers.size(); ++k) follow(k);
      }
      if (i < kFirst) continue;
      tally->wall_ms.push_back(1e3 * secondsSince(begin));
      tally->processor_ms.push_back(1e3 * (processorSeconds() - processor));
      judge(scene, outcomes, tally);
    }
  }

  void judge(const ObjectScene& scene, const std::vector<TrackOutcome>& outcomes,
             Tally* tally) const {
    for (std::size_t k = 0; k < outcomes.size(); ++k) {
      const FieldMetadata& object = fields_[k]->metadata;
      const PoseError error = poseError(outcomes[k].refinement.T_O_C, scene.T_O_C[k], object.centre,
                                        scene.observation.camera, object.symmetries);
      tally->right += outcomes[k].found && error.rotation_rad < 5 * kDegree &&
                      error.object_offset < 0.05 * object.diameter;
      ++tally->poses;
      tally->found.push_back(outcomes[k].refinement.T_O_C);
    }
  }

  void print(const Manner& manner, const Tally& tally) const {
    std::printf("%-40s %.2f ms (95th percentile %.2f), processor %.2f ms; right %d of %d\n",
                manner.name, percentile(tally.wall_ms, 0.5), percentile(tally.wall_ms, 0.95),
                percentile(tally.processor_ms, 0.5), tally.right, tally.poses);
  }

  static bool areEqual(const std::vector<Pose>& a, const std::vector<Pose>& b) {
    bool are_equal = a.size() == b.size();
    for (std::size_t i = 0; are_equal && i < a.size(); ++i) {
      are_equal = a[i].R == b[i].R && a[i].t == b[i].t;
    }
    return are_equal;
  }

  const Options& options_;
  BackendPool backends_;
  std::shared_ptr<Backend> backend_;
  std::vector<std::shared_ptr<const Field>> fields_;
  std::unique_ptr<SceneComposer> scenes_;
};

void addOptions(CLI::App* app, Options* o) {
  app->add_option("--object", o->objects, "a model, and transforms.json of views of it; repeated")
      ->required();
  app->add_option("--photos", o->photos, "one is drawn, to be put behind the objects")->required();
  app->add_option("--scenes", o->scenes, "so many views of the objects");
  app->add_option("--images", o->images, "of each")->check(CLI::Range(6, 100000));
  app->add_option("--width", o->width, "of an image [px]");
  app->add_option("--height", o->height, "of an image [px]");
  app->add_option("--noise", o->noise, "standard deviation, of white");
  app->add_option("--backend", o->backend.backend, "auto, cpu or cuda");
  app->add_option("--threads", o->backend.threads, "of the CPU; 0: all cores");
}

int run(int argc, char** argv) {
  CLI::App app("How long it takes to track several objects in the images of one camera.");
  Options options;
  addOptions(&app, &options);
  CLI11_PARSE(app, argc, argv);
  try {
    Benchmark(options).run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "tracking_together: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) { return nerf_pose_refiner::run(argc, argv); }
