// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// How soon an object that was lost is found again after it has come back into view. A camera takes
// 30 images per second; the tracker gets the newest one whenever it has done with the last, so that
// the time it takes decides which images it sees, as in the node. Only its own time counts: the
// clock stands still while images are composed, though the tracker's thread that renders keyframes
// goes on.

#include <CLI/CLI.hpp>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "concurrency/seconds_since.h"
#include "detection/landmark_file.h"
#include "evaluation/pose_error.h"
#include "evaluation/statistics.h"
#include "field/object_frame.h"
#include "field/object_metadata.h"
#include "math/angle.h"
#include "return_trial.h"
#include "runtime/backend_pool.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kRate_hz = 30, kPatience_s = 8;  // after the object's return

struct Options {
  std::string model, data;
  std::vector<std::string> photos;
  BackendChoice backend = {"cpu", 0, "auto", 0};
  int seeds = 4, first_seed = 1;
  int first = 0, every = 1;  // views
  bool is_near = false, verbose = false, each_image = false;
  double least_gone_s = 1, most_gone_s = 4;
  TrackingRules rules = lookingEverywhere();

  static TrackingRules lookingEverywhere() {
    TrackingRules rules;
    rules.start = TrackStart::kBoth;
    return rules;
  }
};

/// What came of a trial.
struct Recovery {
  bool was_tracked = false;                                  ///< before the object went away
  double found_s = std::numeric_limits<double>::infinity();  ///< after its return
  double work_s = 0;                                         ///< of the image it was found in
  bool is_by_detection = false;                              ///< in the whole image
  int looked_at = 0;                                         ///< images since its return
  int wrong_while_gone = 0, wrong_after = 0;                 ///< published poses
};

/// The images of a camera, as a tracker gets them that is busy now and then.
class CameraClock {
 public:
  double now_s() const { return now_s_; }
  double stamp_s() const { return static_cast<double>(image_) / kRate_hz; }
  std::int64_t stamp_ns() const { return std::llround(1e9 * stamp_s()); }

  /// The next image is taken.
  void takeNext() { ++image_; }
  /// Whether a newer one has come already, which a mailbox would have replaced this one by.
  bool isOutdated() const { return static_cast<double>(image_ + 1) / kRate_hz <= now_s_; }
  void waitForImage() { now_s_ = std::max(now_s_, stamp_s()); }
  void spend(double seconds) { now_s_ += seconds; }

 private:
  std::int64_t image_ = 0;
  double now_s_ = 0;
};

class Benchmark {
 public:
  explicit Benchmark(const Options& options)
      : options_(options),
        views_(loadDataset(options.data).views),
        field_(fieldWithScale(options.model)),
        object_(field_->metadata),
        tracker_(makeSearch(), settingsOf(options), connections()) {
    std::future<void> in_use = tracker_.offerModel(field_);
    tracker_.applyModels();
    in_use.get();
  }

  void run() {
    runTrial(options_.first, 0);  // makes what the first search has to make
    const auto last_seed = static_cast<std::uint64_t>(options_.first_seed + options_.seeds);
    for (auto seed = static_cast<std::uint64_t>(options_.first_seed); seed < last_seed; ++seed) {
      for (std::size_t view = options_.first; view < views_.size(); view += options_.every) {
        const Recovery recovery = runTrial(view, seed);
        if (options_.verbose) print(view, seed, recovery);
        all_.push_back(recovery);
      }
    }
    report();
  }

 private:
  static std::shared_ptr<const Field> fieldWithScale(const std::string& model) {
    auto field = std::make_shared<Field>(loadField(model));
    if (!(field->metadata.metres_per_unit > 0)) field->metadata.metres_per_unit = 1;
    return field;
  }

  static TrackerSettings settingsOf(const Options& options) {
    TrackerSettings settings;
    settings.rules = options.rules;
    return settings;
  }

  std::unique_ptr<ObjectSearch> makeSearch() {
    const TrackerSettings settings = settingsOf(options_);
    DetectionSetup detection;
    detection.landmarks_path = [this](const auto&) { return landmarkPathOf(options_.model); };
    detection.is_expected = options_.rules.start != TrackStart::kInitialPose;
    return std::make_unique<RefinerSearch>(
        [this] { return backends_.searchProcessor(options_.backend); }, settings.initial.refiner,
        settings.tracking.refiner, detection);
  }

  TrackerConnections connections() {
    TrackerConnections connections;
    connections.clock_ns = [this] { return clock_.stamp_ns(); };
    return connections;
  }

  Recovery runTrial(std::size_t view, std::uint64_t seed) {
    const ReturnTrial trial = drawReturn(views_, {view, 1000 * seed + view, options_.is_near,
                                                  options_.least_gone_s, options_.most_gone_s});
    clock_.takeNext();
    const double begin_s = clock_.stamp_s(), back_s = trial.seen_s + trial.gone_s;
    tracker_.reset();
    const Pose first = imageAt(trial, 0, views_, options_.photos).T_O_C;
    TimedPose hint;
    hint.T_P_U = ObjectFrame::inMetres(object_).objectInCamera(first);
    hint.frame_id = "camera";
    tracker_.offer(hint);
    Recovery recovery;
    while (true) {
      const double time_s = takeImage() - begin_s;
      if (time_s > back_s + kPatience_s) break;
      const ReturnImage image = imageAt(trial, time_s, views_, options_.photos);
      const double before_s = clock_.now_s();
      const TrackOutcome outcome = track(image);
      const bool is_right = outcome.trusted && isRight(outcome, image);
      if (options_.each_image) print(time_s, outcome, image);
      if (time_s < trial.seen_s) {
        recovery.was_tracked = is_right;
      } else if (time_s < back_s) {
        recovery.wrong_while_gone += outcome.trusted;
      } else {
        recovery.looked_at += outcome.refined;
        recovery.wrong_after += outcome.trusted && !is_right;
        if (!is_right) continue;
        recovery.found_s = clock_.now_s() - begin_s - back_s;
        recovery.work_s = clock_.now_s() - before_s;
        recovery.is_by_detection = !outcome.prior;
        break;
      }
    }
    return recovery;
  }

  /// Waits for the newest image, after those that came before it have come. @return its time.
  double takeImage() {
    do {
      clock_.takeNext();
      tracker_.readClock();
      tracker_.imageArrived();
    } while (clock_.isOutdated());
    clock_.waitForImage();
    return clock_.stamp_s();
  }

  TrackOutcome track(const ReturnImage& image) {
    TrackerImage taken;
    taken.at = {"camera", clock_.stamp_ns()};
    taken.observe = [&](bool) { return image.observation; };
    taken.clock_jumps = tracker_.readClock();
    const auto begin = std::chrono::steady_clock::now();
    const TrackOutcome outcome = tracker_.process(taken);
    clock_.spend(secondsSince(begin));
    return outcome;
  }

  PoseError errorOf(const TrackOutcome& outcome, const ReturnImage& image) const {
    return poseError(outcome.refinement.T_O_C, image.T_O_C, object_.centre,
                     image.observation.camera, object_.symmetries);
  }

  bool isRight(const TrackOutcome& outcome, const ReturnImage& image) const {
    const PoseError error = errorOf(outcome, image);
    return error.rotation_rad < 5 * kDegree && error.object_offset < 0.05 * object_.diameter;
  }

  void print(double time_s, const TrackOutcome& outcome, const ReturnImage& image) const {
    const PoseError error = errorOf(outcome, image);
    const char* const how = !outcome.refined    ? "skipped"
                            : !outcome.prior    ? "detection"
                            : outcome.from_last ? "tracking"
                                                : "search";
    std::printf("  %.2f s %s: %s %s, score %.2f, %.1f deg %.1f %% off, until %.2f s; %s\n", time_s,
                how,
                outcome.trusted ? "trusted"
                : outcome.found ? "found"
                                : "nothing",
                toString(outcome.state), outcome.score, error.rotation_rad / kDegree,
                100 * error.object_offset / object_.diameter,
                clock_.now_s() - clock_.stamp_s() + time_s, outcome.message.c_str());
  }

  static void print(std::size_t view, std::uint64_t seed, const Recovery& one) {
    std::printf(
        "%2zu/%llu: %s, found after %.2f s (%d images looked at, the last %.2f s, by %s), "
        "published wrong: gone %d, after %d\n",
        view, static_cast<unsigned long long>(seed),
        one.was_tracked ? "tracked" : "NOT TRACKED BEFORE", one.found_s, one.looked_at, one.work_s,
        one.is_by_detection ? "detection" : "the last pose", one.wrong_while_gone, one.wrong_after);
    std::fflush(stdout);
  }

  void report() const {
    std::vector<double> found_s;
    int untracked = 0, by_detection = 0, wrong_while_gone = 0, wrong_after = 0;
    for (const Recovery& one : all_) {
      wrong_while_gone += one.wrong_while_gone;
      wrong_after += one.wrong_after;
      untracked += !one.was_tracked;
      if (!one.was_tracked) continue;
      found_s.push_back(one.found_s);
      by_detection += std::isfinite(one.found_s) && one.is_by_detection;
    }
    if (found_s.empty()) throw std::runtime_error("the object was never tracked");
    const auto within = [&](double seconds) {
      return recallAt(found_s, seconds) * static_cast<double>(found_s.size());
    };
    std::printf(
        "%s: %zu trials (%d others: not tracked before), found %.0f (%d of them in the whole "
        "image), within 1 s %.0f, within 5 s %.0f; median %.2f s, p95 %.2f s; published wrong: %d "
        "while gone, %d after\n",
        object_.name.c_str(), found_s.size(), untracked, within(kPatience_s * 2), by_detection,
        within(1), within(5), percentile(found_s, 0.5), percentile(found_s, 0.95), wrong_while_gone,
        wrong_after);
  }

  const Options options_;
  const std::vector<PosedView> views_;
  const std::shared_ptr<const Field> field_;
  const FieldMetadata& object_;
  BackendPool backends_;
  CameraClock clock_;
  ObjectTracker tracker_;
  std::vector<Recovery> all_;
};

void addOptions(CLI::App* app, Options* o) {
  const std::map<std::string, TrackStart> starts = {{"initial_pose", TrackStart::kInitialPose},
                                                    {"both", TrackStart::kBoth}};
  app->add_option("model", o->model, "the object's .safetensors")->required();
  app->add_option("data", o->data, "a dataset's transforms.json: views of the object")->required();
  app->add_option("--photos", o->photos, "one is drawn, to be put behind the object")->required();
  app->add_flag("--near", o->is_near, "it comes back near where it was; else elsewhere");
  app->add_option("--gone", o->least_gone_s, "for so long at least [s]");
  app->add_option("--most-gone", o->most_gone_s, "at most [s]");
  app->add_option("--seeds", o->seeds, "so many trials of each view");
  app->add_option("--first-seed", o->first_seed, "number of the first of them");
  app->add_option("--start", o->rules.start, "the node's ~start")
      ->transform(CLI::CheckedTransformer(starts));
  app->add_option("--rate", o->rules.detect_rate_hz, "the node's ~detect_rate_hz");
  app->add_option("--share", o->rules.detect_share, "the node's ~detect_share");
  app->add_option("--recover", o->rules.recover_s, "the node's ~recover_s");
  app->add_option("--backend", o->backend.backend, "auto, cpu or cuda");
  app->add_option("--threads", o->backend.threads, "of the CPU; 0: all cores");
  app->add_option("--first", o->first, "number of the first view");
  app->add_option("--every", o->every, "only every so many-th view");
  app->add_flag("--verbose", o->verbose, "a line for each trial");
  app->add_flag("--each-image", o->each_image, "a line for each image");
}

int run(int argc, char** argv) {
  CLI::App app("How soon a lost object is found that has come back into view.");
  Options options;
  addOptions(&app, &options);
  CLI11_PARSE(app, argc, argv);
  try {
    Benchmark(options).run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "recovery: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) { return nerf_pose_refiner::run(argc, argv); }
