// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// How long it takes to look for many objects in one image, without a hint. The image shows some of
// the objects; where there are fewer models than objects, each model is loaded several times.

#include <CLI/CLI.hpp>

#include <chrono>
#include <cstdio>
#include <exception>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "concurrency/seconds_since.h"
#include "detection/landmark_file.h"
#include "detection/object_detector.h"
#include "evaluation/pose_error.h"
#include "evaluation/statistics.h"
#include "field/object_metadata.h"
#include "math/angle.h"
#include "object_scene.h"
#include "processor_seconds.h"
#include "runtime/backend_pool.h"
#include "trust/keyframe_scores.h"
#include "trust/look_alikes.h"

namespace nerf_pose_refiner {
namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  std::vector<std::pair<std::string, std::string>> objects;  // model and data
  std::vector<std::string> photos;
  BackendChoice backend = {"cpu", 0, "auto", 0};
  int count = 20, shown = 0, images = 4;
  int width = 640, height = 480;
};

/// An object that is looked for.
struct LookedFor {
  std::size_t kind;  // number of its model
  std::shared_ptr<const LoadedField> field;
  std::unique_ptr<ObjectDetector> detector;
};

/// Seconds of all objects together.
struct Times {
  double all = 0, processor = 0, at_once = 0;
  DetectionTimes parts;  // of `all`
};

class Benchmark {
 public:
  explicit Benchmark(const Options& options) : options_(options) {
    const std::size_t kinds = options_.objects.size();
    shown_ = options_.shown > 0 ? std::min<std::size_t>(options_.shown, kinds) : kinds;
    const SearchProcessor processor = backends_.searchProcessor(options_.backend);
    backend_ = processor.backend;
    for (std::size_t i = 0; i < static_cast<std::size_t>(options_.count); ++i) {
      objects_.push_back(load(i % kinds));
    }
    std::vector<std::string> data;
    for (std::size_t kind = 0; kind < shown_; ++kind) data.push_back(options_.objects[kind].second);
    scenes_.emplace(data, options_.photos, options_.width, options_.height);
  }

  void run() {
    std::printf("%d objects of %zu models, %zu of which an image shows\n", options_.count,
                options_.objects.size(), shown_);
    measure(scenes_->compose(
        static_cast<std::size_t>(options_.images)));  // makes what the first search has to make
    right_ = wrong_ = instances_ = 0;
    std::vector<Times> all;
    for (int image = 0; image < options_.images; ++image) {
      all.push_back(measure(scenes_->compose(static_cast<std::size_t>(image))));
      print(all.back());
    }
    const auto setMedian = [&](double* of, const auto& partOf) {
      std::vector<double> values;
      for (const Times& one : all) values.push_back(partOf(one));
      *of = percentile(values, 0.5);
    };
    std::printf("median: ");
    Times middle;
    for (double Times::*part : {&Times::all, &Times::processor, &Times::at_once}) {
      setMedian(&(middle.*part), [&](const Times& one) { return one.*part; });
    }
    for (double DetectionTimes::*part :
         {&DetectionTimes::features, &DetectionTimes::landmarks, &DetectionTimes::templates,
          &DetectionTimes::ranking, &DetectionTimes::settling}) {
      setMedian(&(middle.parts.*part), [&](const Times& one) { return one.parts.*part; });
    }
    print(middle);
    std::printf("shown objects found %d of %d; published wrong %d\n", right_, instances_, wrong_);
  }

 private:
  /// As RefinerSearch has it.
  LookedFor load(std::size_t kind) {
    const std::string& path = options_.objects[kind].first;
    LookedFor object;
    object.kind = kind;
    object.field = backend_->load(std::make_shared<const Field>(loadField(path)));
    DetectionSettings settings;
    settings.max_instances = 1;
    settings.model = settings.model.adaptedTo(backend_->info());
    DetectionModel model =
        detectionModelFor(*object.field, settings.model, landmarkPathOf(path), {});
    object.detector =
        std::make_unique<ObjectDetector>(backend_.get(), object.field, std::move(model), settings);
    object.detector->use(keyframeScoresOf(backend_.get(), *object.field, {}));
    object.detector->use(lookAlikesOf(backend_.get(), *object.field, {}));
    return object;
  }

  Times measure(const ObjectScene& scene) {
    Times times;
    times.at_once = detectAtOnce(differentBits(scene.observation));
    const double processor = processorSeconds();
    for (const LookedFor& object : objects_) {
      const Detections found = object.detector->detect(scene.observation, {}, {});
      times.all += found.seconds;
      times.parts += found.times;
      judge(found, object, scene);
    }
    times.processor = processorSeconds() - processor;
    return times;
  }

  /// The same to the eye, but another image: its features are not known.
  static Observation differentBits(Observation observation) {
    for (int c = 0; c < 3; ++c) observation.image.at(0, 0, c) = 1 - observation.image.at(0, 0, c);
    return observation;
  }

  /// Each object in a thread of its own, as nodelets do.
  double detectAtOnce(const Observation& observation) {
    const auto begin = Clock::now();
    std::vector<std::thread> threads;
    for (const LookedFor& object : objects_) {
      threads.emplace_back([&] { object.detector->detect(observation, {}, {}); });
    }
    for (std::thread& thread : threads) thread.join();
    return secondsSince(begin);
  }

  void judge(const Detections& found, const LookedFor& object, const ObjectScene& scene) {
    const bool is_shown = object.kind < shown_;
    instances_ += is_shown;
    for (const Refinement& one : found.found) {
      const bool is_right = is_shown && isRight(one, object, scene);
      right_ += is_right;
      wrong_ += !is_right;
    }
  }

  static bool isRight(const Refinement& found, const LookedFor& object, const ObjectScene& scene) {
    const FieldMetadata& metadata = object.field->field().metadata;
    const PoseError error = poseError(found.T_O_C, scene.T_O_C[object.kind], metadata.centre,
                                      scene.observation.camera, metadata.symmetries);
    return error.rotation_rad < 5 * kDegree && error.object_offset < 0.05 * metadata.diameter;
  }

  static void print(const Times& times) {
    std::printf(
        "%.2f s one after the other (features %.3f, landmarks %.3f, templates %.2f, "
        "ranking %.2f, settling %.2f; processor %.2f), at once %.2f s\n",
        times.all, times.parts.features, times.parts.landmarks, times.parts.templates,
        times.parts.ranking, times.parts.settling, times.processor, times.at_once);
    std::fflush(stdout);
  }

  const Options options_;
  std::size_t shown_;
  BackendPool backends_;
  std::shared_ptr<Backend> backend_;
  std::vector<LookedFor> objects_;
  std::optional<SceneComposer> scenes_;  // of the models that are shown
  int right_ = 0, wrong_ = 0, instances_ = 0;
};

void addOptions(CLI::App* app, Options* o) {
  app->add_option("--object", o->objects, "a model, and transforms.json of views of it; repeated")
      ->required();
  app->add_option("--photos", o->photos, "one is drawn, to be put behind the objects")->required();
  app->add_option("--count", o->count, "of the objects that are looked for");
  app->add_option("--shown", o->shown, "only the first so many models are in the image; 0: all");
  app->add_option("--images", o->images, "so many are searched");
  app->add_option("--width", o->width, "of the image [px]");
  app->add_option("--height", o->height, "of the image [px]");
  app->add_option("--backend", o->backend.backend, "auto, cpu or cuda");
  app->add_option("--threads", o->backend.threads, "of the CPU; 0: all cores");
}

int run(int argc, char** argv) {
  CLI::App app("How long it takes to look for many objects in one image.");
  Options options;
  addOptions(&app, &options);
  CLI11_PARSE(app, argc, argv);
  try {
    Benchmark(options).run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "many_objects: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) { return nerf_pose_refiner::run(argc, argv); }
