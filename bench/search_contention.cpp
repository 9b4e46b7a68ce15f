// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// What it costs a tracked object that another one is looked for, which no image shows: the time
// from an image's arrival to the pose, alone and beside the search, by turns. Both get the images
// of a recording at their stamps and share the processor, as two nodelets of one process do.

#include <CLI/CLI.hpp>

#include <atomic>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "concurrency/frame_mailbox.h"
#include "concurrency/seconds_since.h"
#include "detection/landmark_file.h"
#include "evaluation/statistics.h"
#include "field/object_frame.h"
#include "field/object_metadata.h"
#include "image/io.h"
#include "processor_seconds.h"
#include "recorded_sequence.h"
#include "runtime/backend_pool.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {
namespace {

using Clock = std::chrono::steady_clock;

struct Options {
  std::string model, recording, lost_model;
  BackendChoice backend = {"cpu", 0, "auto", 0};
  int runs = 3, frames = 300;
  double detect_rate_hz = TrackingRules().detect_rate_hz;
  double recover_s = 0;
};

/// An image and the time at which it was taken, which goes on from run to run.
struct TakenImage {
  const Image8* image;
  std::int64_t stamp_ns;
};

/// Looks for the lost object in a thread of its own.
class LostObject {
 public:
  LostObject(ObjectTracker* tracker, const Camera& camera)
      : tracker_(tracker), camera_(camera), thread_([this] { work(); }) {}

  ~LostObject() {
    is_over_ = true;
    tracker_->stop();
    images_.wake();
    thread_.join();
  }

  void put(const TakenImage& taken) { images_.put(taken); }
  int images() const { return looked_at_; }
  double busy_s() const { return busy_s_; }

 private:
  void work() {
    while (!is_over_) {
      const auto taken = images_.take(std::chrono::milliseconds(100));
      if (!taken) continue;
      const auto begin = Clock::now();
      const TrackOutcome outcome = tracker_->track(
          {{"camera", taken->stamp_ns}, [&](bool) { return observe(*taken->image, camera_); }});
      if (!outcome.refined) continue;
      ++looked_at_;
      busy_s_ = busy_s_ + secondsSince(begin);
      if (outcome.trusted) std::printf("the lost object was 'found'\n");
    }
  }

  ObjectTracker* tracker_;
  Camera camera_;
  FrameMailbox<TakenImage> images_;
  std::atomic<bool> is_over_{false};
  std::atomic<int> looked_at_{0};
  std::atomic<double> busy_s_{0};
  std::thread thread_;
};

/// What was measured of the images of some runs.
struct Tally {
  std::vector<double> ms;  // from an image's arrival to the pose
  int trusted = 0, dropped = 0, looked_at = 0;
  double seconds = 0, processor_s = 0, busy_s = 0;

  void print(const char* what) const {
    std::printf(
        "%-8s median %.1f ms, p95 %.1f ms, p99 %.1f ms of %zu images (trusted %d, dropped %d); "
        "%.2f cores busy; lost object: %d images, busy %.2f of the time\n",
        what, percentile(ms, 0.5), percentile(ms, 0.95), percentile(ms, 0.99), ms.size(), trusted,
        dropped, processor_s / seconds, looked_at, busy_s / seconds);
    std::fflush(stdout);
  }
};

class Benchmark {
 public:
  explicit Benchmark(const Options& options)
      : options_(options),
        sequence_(readSequence(options.recording)),
        field_(fieldWithScale(options.model)),
        lost_field_(fieldWithScale(options.lost_model)) {
    const auto frames = std::min<std::size_t>(options.frames, sequence_.frames.size());
    for (std::size_t i = 0; i < frames; ++i) {
      images_.push_back(readImage(sequence_.frames[i].file));
    }
    tracker_ = makeTracker(options.model, field_, {});
  }

  void run() {
    Tally unused, alone, beside;
    pace(nullptr, &unused);  // renders the keyframes that all runs use
    for (int i = 0; i < options_.runs; ++i) {
      pace(nullptr, &alone);
      besideSearch(&beside);
    }
    alone.print("alone");
    beside.print("beside");
    std::printf("median %.2f x, p95 %.2f x\n",
                percentile(beside.ms, 0.5) / percentile(alone.ms, 0.5),
                percentile(beside.ms, 0.95) / percentile(alone.ms, 0.95));
  }

 private:
  static std::shared_ptr<const Field> fieldWithScale(const std::string& model) {
    auto field = std::make_shared<Field>(loadField(model));
    if (!(field->metadata.metres_per_unit > 0)) field->metadata.metres_per_unit = 1;
    return field;
  }

  /// As the nodelet makes it.
  std::unique_ptr<ObjectTracker> makeTracker(const std::string& model,
                                             const std::shared_ptr<const Field>& field,
                                             const TrackingRules& rules) {
    TrackerSettings settings;
    settings.rules = rules;
    DetectionSetup detection;
    detection.landmarks_path = [model](const auto&) { return landmarkPathOf(model); };
    detection.is_expected = true;
    auto search = std::make_unique<RefinerSearch>(
        [this] { return backends_.searchProcessor(options_.backend); }, settings.initial.refiner,
        settings.tracking.refiner, detection);
    auto tracker = std::make_unique<ObjectTracker>(std::move(search), settings);
    std::future<void> in_use = tracker->offerModel(field);
    tracker->applyModels();
    in_use.get();
    return tracker;
  }

  TimedPose poseOfFirst() const {
    TimedPose pose;
    pose.T_P_U = sequence_.frames.front().T_C_O;
    pose.frame_id = "camera";
    return pose;
  }

  void besideSearch(Tally* tally) {
    TrackingRules rules;
    rules.start = TrackStart::kBoth;
    rules.detect_rate_hz = options_.detect_rate_hz;
    rules.recover_s = options_.recover_s;
    const std::unique_ptr<ObjectTracker> tracker =
        makeTracker(options_.lost_model, lost_field_, rules);
    if (options_.recover_s > 0) tracker->offer(poseOfFirst());
    // What the first search has to make is made before.
    tracker->track({{"camera", stamp_ns_ - 2000000000},
                    [&](bool) { return observe(images_.front(), sequence_.camera); }});
    LostObject lost(tracker.get(), sequence_.camera);
    pace(&lost, tally);
    tally->looked_at += lost.images();
    tally->busy_s += lost.busy_s();
  }

  /// Tracks the recording once, the images at their stamps.
  void pace(LostObject* lost, Tally* tally) {
    constexpr std::size_t kBegin = 30;  // images of the first search and what it leads to
    tracker_->reset();
    tracker_->offer(poseOfFirst());
    const std::int64_t first_ns = sequence_.frames.front().stamp_ns;
    const double processor = processorSeconds();
    const auto begin = Clock::now();
    const auto arrivalOf = [&](std::size_t i) {
      return begin + std::chrono::nanoseconds(sequence_.frames[i].stamp_ns - first_ns);
    };
    for (std::size_t i = 0; i < images_.size(); ++i) {
      std::this_thread::sleep_until(arrivalOf(i));
      const TakenImage taken = {&images_[i], stamp_ns_ + sequence_.frames[i].stamp_ns - first_ns};
      if (lost != nullptr) lost->put(taken);
      if (i + 1 < images_.size() && Clock::now() >= arrivalOf(i + 1)) {
        tally->dropped += i >= kBegin;
        continue;
      }
      const TrackOutcome outcome =
          tracker_->track({{"camera", taken.stamp_ns},
                           [&](bool) { return observe(*taken.image, sequence_.camera); }});
      if (i < kBegin) continue;
      tally->ms.push_back(1e3 * secondsSince(arrivalOf(i)));
      tally->trusted += outcome.trusted;
    }
    tally->seconds += secondsSince(begin);
    tally->processor_s += processorSeconds() - processor;
    stamp_ns_ += sequence_.frames[images_.size() - 1].stamp_ns - first_ns + 10000000000;
  }

  const Options options_;
  const RecordedSequence sequence_;
  const std::shared_ptr<const Field> field_, lost_field_;
  BackendPool backends_;
  std::vector<Image8> images_;
  std::unique_ptr<ObjectTracker> tracker_;
  std::int64_t stamp_ns_ = 10000000000;  // of the next run's first image
};

void addOptions(CLI::App* app, Options* o) {
  app->add_option("model", o->model, "of the object that is tracked")->required();
  app->add_option("recording", o->recording, "of it: a folder with sequence.json")->required();
  app->add_option("lost", o->lost_model, "of the object that is looked for")->required();
  app->add_option("--runs", o->runs, "of each kind, by turns");
  app->add_option("--frames", o->frames, "of the recording, at most");
  app->add_option("--rate", o->detect_rate_hz, "the node's ~detect_rate_hz");
  app->add_option("--recover", o->recover_s,
                  "the lost object is looked for around a pose, too, for so long [s]");
  app->add_option("--backend", o->backend.backend, "auto, cpu or cuda");
  app->add_option("--threads", o->backend.threads, "of the CPU; 0: all cores");
}

int run(int argc, char** argv) {
  CLI::App app("What the search for a lost object costs a tracked one.");
  Options options;
  addOptions(&app, &options);
  CLI11_PARSE(app, argc, argv);
  try {
    Benchmark(options).run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "search_contention: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) { return nerf_pose_refiner::run(argc, argv); }
