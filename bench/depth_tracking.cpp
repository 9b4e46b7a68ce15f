// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Tracks an object through recordings (recordings/README.md) twice, by colours alone and with
// depth; or, with --alone, once by depth alone, for which the recordings need no images. The depth
// is that of the recording's mesh, as a stereo camera beside the colour camera measures it: errors
// that go together over windows, shadows beside edges, holes, steps. Poses count as in
// recorded_tracking: within 5 degrees and 5 % of the diameter, else the tracker is told the true
// one.

#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "backend/make_backend.h"
#include "evaluation/pose_error.h"
#include "evaluation/statistics.h"
#include "field/object_frame.h"
#include "field/object_metadata.h"
#include "geometry/matrix6.h"
#include "math/angle.h"
#include "recorded_depth.h"
#include "runtime/shared_backend.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {
namespace {

struct Options {
  std::string model;
  std::vector<std::string> recordings;
  BackendChoice backend;
  int every = 1, frames = 1 << 20;
  bool alone = false;
  int first_poses = 0;  // of a frame; 0: the recording is tracked
  RecordedDepthOptions depth;
  bool verbose = false;
};

/// What was measured of the frames of one or more recordings.
struct Tally {
  std::vector<double> along_percent, across_percent, deg, milliseconds, squared_error;
  int frames = 0, right = 0, trusted = 0, trusted_wrong = 0;
  std::map<std::string, int> refusals;
  int used = 0;

  void print(const std::string& name) const {
    if (right == 0) {
      std::printf("%-34s right 0 of %d, trusted %d\n", name.c_str(), frames, trusted);
      return;
    }
    double squared = 0;
    for (const double value : squared_error) squared += value / 6;
    std::printf(
        "%-34s right %.3f of %d, trusted %.3f, wrong ones %d; along %.3f %% (95th %.3f), across "
        "%.3f %%, %.3f deg; error^2/6 %.2f; %.1f ms; depth used %d\n",
        name.c_str(), static_cast<double>(right) / frames, frames,
        static_cast<double>(trusted) / frames, trusted_wrong, percentile(along_percent, 0.5),
        percentile(along_percent, 0.95), percentile(across_percent, 0.5), percentile(deg, 0.5),
        squared / static_cast<double>(std::max<std::size_t>(1, squared_error.size())),
        percentile(milliseconds, 0.5), used);
    for (const auto& [message, count] : refusals) {
      std::printf("    refused %d times: %s\n", count, message.c_str());
    }
    std::fflush(stdout);
  }
};

/// What the tracker is shown.
enum class Shown { kColours, kColoursAndDepth, kDepth };

/// Tracks one recording.
class DepthTracking {
 public:
  DepthTracking(const Options& options, const std::string& folder, Shown shown)
      : options_(options),
        shown_(shown),
        field_(fieldWithScale(options.model)),
        recording_(depthOptions(), folder, field_->metadata),
        sequence_(recording_.sequence()),
        frame_(ObjectFrame::inMetres(field_->metadata)),
        tracker_(std::make_shared<SharedBackend>(makeBackend(options.backend)), forgetLabel(),
                 settingsFromFile()) {}

  void run(Tally* tally) {
    if (options_.first_poses == 0) tellPose(0);
    int done = 0;
    for (std::size_t i = 0; i < sequence_.frames.size() && done < options_.frames;
         i += options_.every, ++done) {
      const Observation observation = observationOf(i);
      if (options_.first_poses == 0) judge(i, track(i, observation, tally), tally);
      for (int k = 0; k < options_.first_poses; ++k) {
        tellHint(i);
        ++untracked_;  // an image of the same stamp would be left alone
        judge(i, track(i, observation, tally), tally);
      }
    }
  }

 private:
  static std::shared_ptr<Field> fieldWithScale(const std::string& model) {
    auto field = std::make_shared<Field>(loadField(model));
    if (!(field->metadata.metres_per_unit > 0)) field->metadata.metres_per_unit = 1;
    return field;
  }

  /// Depth alone is in the frame of the depth camera itself.
  RecordedDepthOptions depthOptions() const {
    RecordedDepthOptions options = options_.depth;
    if (shown_ == Shown::kDepth) options.beside_m = 0;
    return options;
  }

  /// Depth does not show the label: the bottle is told to be symmetric where depth is alone.
  std::shared_ptr<const Field> forgetLabel() {
    const auto hides_label = [](const RecordedFrame& frame) { return !frame.label_visible; };
    const bool has_label =
        std::any_of(sequence_.frames.begin(), sequence_.frames.end(), hides_label);
    if (has_label && shown_ == Shown::kDepth) field_->metadata.symmetries = aboutZ();
    return field_;
  }

  static Symmetries aboutZ() {
    return Symmetries(SymmetryAxis{Eigen::Vector3d::UnitZ(), Eigen::Vector3d::Zero()}, {});
  }

  static TrackerSettings settingsFromFile() {
    TrackerSettings settings;
    settings.tracking.refiner.keyframes.real_time = false;
    return settings;
  }

  TrackOutcome track(std::size_t i, const Observation& observation, Tally* tally) {
    const auto begin = std::chrono::steady_clock::now();
    TrackOutcome outcome = tracker_.track(
        {{"camera", sequence_.frames[i].stamp_ns + untracked_}, [&](bool) { return observation; }});
    const std::chrono::duration<double, std::milli> spent =
        std::chrono::steady_clock::now() - begin;
    tally->milliseconds.push_back(spent.count());
    return outcome;
  }

  /// As far off as a hint may be.
  void tellHint(std::size_t i) {
    std::uniform_real_distribution<double> uniform(-1, 1);
    Eigen::Vector3d turn, shift;
    for (int a = 0; a < 3; ++a) turn[a] = kSearchRotation_rad * uniform(random_);
    for (int a = 0; a < 3; ++a)
      shift[a] = kSearchTranslation * recording_.diameter_m() * uniform(random_);
    const Pose& T_C_O = sequence_.frames[i].T_C_O;
    const Eigen::Vector3d centre = recording_.centreInCamera(i);
    const Eigen::Matrix3d R = expSO3(turn);
    tracker_.reset();
    tracker_.offer(
        {{R * T_C_O.R, centre + shift + R * (T_C_O.t - centre)}, "camera", 0, false, {}});
  }

  void tellPose(std::size_t i) {
    tracker_.reset();
    tracker_.offer({sequence_.frames[i].T_C_O, "camera", 0, false, {}});
  }

  Observation observationOf(std::size_t i) const {
    if (shown_ == Shown::kDepth) return observe(recording_.depthOf(i));
    Observation observation = recording_.coloursOf(i);
    if (shown_ == Shown::kColoursAndDepth) observation.depth = recording_.depthOf(i);
    return observation;
  }

  Symmetries symmetriesAt(const RecordedFrame& frame) const {
    return frame.label_visible ? field_->metadata.symmetries : aboutZ();
  }

  void judge(std::size_t i, const TrackOutcome& outcome, Tally* tally) {
    const RecordedFrame& frame = sequence_.frames[i];
    const FieldMetadata& object = field_->metadata;
    const Refinement& found = outcome.refinement;
    const Pose truth = frame_.cameraInModel(frame.T_C_O);
    const PoseError error =
        poseError(found.T_O_C, truth, object.centre, sequence_.camera, symmetriesAt(frame));
    const double deg = error.rotation_rad / kDegree;
    const double fraction = error.object_offset / object.diameter;
    const bool is_right =
        outcome.found && deg < 5 && fraction < 0.05 && options_.depth.shown.empty();
    ++tally->frames;
    tally->right += is_right;
    tally->trusted += outcome.trusted;
    tally->trusted_wrong += outcome.trusted && !is_right;
    tally->used += found.depth.use == DepthUse::kUsed;
    if (found.depth.use == DepthUse::kRefused) {
      ++tally->refusals[found.depth.message.substr(
          0, found.depth.message.find_first_of("0123456789"))];
    }
    const Eigen::Vector3d true_C = truth.inverse() * object.centre;
    const Eigen::Vector3d away = found.T_O_C.inverse() * object.centre - true_C;
    const double along = away.dot(true_C.normalized());
    if (is_right) {
      tally->deg.push_back(deg);
      tally->along_percent.push_back(100 * std::abs(along) / object.diameter);
      tally->across_percent.push_back(100 * (away - along * true_C.normalized()).norm() /
                                      object.diameter);
      const Vector6 twist = cameraTwist(found.T_O_C, truth, object.centre);
      tally->squared_error.push_back(std::min(100.0, squaredDistance(twist, found.covariance)));
    }
    if (options_.verbose) {
      std::printf(
          "%3zu: along %.3f %%, %.3f deg, score %.3f; depth %d: %.2f measured, %.2f agree, "
          "%.2f nearer, %.2f farther, bias %.2f +- %.2f mm %s\n",
          i, 100 * along / object.diameter, deg, outcome.score, static_cast<int>(found.depth.use),
          found.depth.measured, found.depth.agreeing, found.depth.nearer, found.depth.farther,
          1e3 * found.depth.bias_m, 1e3 * found.depth.bias_dev_m, found.depth.message.c_str());
    }
    if (!is_right && options_.first_poses == 0) tellPose(i);
  }

  const Options& options_;
  const Shown shown_;
  std::shared_ptr<Field> field_;
  RecordedDepth recording_;
  const RecordedSequence& sequence_;
  ObjectFrame frame_;
  ObjectTracker tracker_;
  std::mt19937_64 random_;
  std::int64_t untracked_ = 0;  // first poses so far
};

void addOptions(CLI::App* app, Options* options) {
  app->add_option("model", options->model, "the object's .safetensors")->required();
  app->add_option("recordings", options->recordings,
                  "folders with sequence.json, frames/ and object.obj")
      ->required();
  app->add_option("--backend", options->backend.backend, "auto, cpu or cuda");
  app->add_option("--threads", options->backend.threads, "of the CPU; 0: all cores");
  app->add_option("--every", options->every, "uses every so many-th frame")
      ->check(CLI::Range(1, 1000));
  app->add_option("--frames", options->frames, "of each recording, at most");
  options->depth.addTo(app);
  app->add_flag("--alone", options->alone, "depth alone, without colours");
  app->add_option("--first-poses", options->first_poses,
                  "so many first poses of each frame, from starts up to 15 degrees and 15 % of the "
                  "diameter off per axis, instead of tracking");
  app->add_flag("--verbose", options->verbose, "a line for each frame");
}

int run(int argc, char** argv) {
  CLI::App app("Tracks an object through recordings by colours alone and with a depth camera.");
  Options options;
  addOptions(&app, &options);
  CLI11_PARSE(app, argc, argv);
  try {
    if (options.alone) {
      Tally depth;
      for (const std::string& folder : options.recordings) {
        DepthTracking(options, folder, Shown::kDepth).run(&depth);
      }
      depth.print("depth alone, fault: " + options.depth.fault);
      return 0;
    }
    Tally colours, with;
    for (const std::string& folder : options.recordings) {
      DepthTracking(options, folder, Shown::kColours).run(&colours);
      DepthTracking(options, folder, Shown::kColoursAndDepth).run(&with);
    }
    colours.print("colours alone");
    with.print("with depth, fault: " + options.depth.fault);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "depth_tracking: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) { return nerf_pose_refiner::run(argc, argv); }
