// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Tracks an object through recordings that another renderer made, with the tracker and the defaults
// of the node, in the protocol of RBOT (Tjaden et al. 2018): a frame counts if it is within 5
// degrees and 5 % of the diameter; a pose that is farther off is lost, and the tracker is told the
// true one.

#include <time.h>
#include <CLI/CLI.hpp>

#include <array>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <memory>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "backend/make_backend.h"
#include "evaluation/pose_error.h"
#include "evaluation/statistics.h"
#include "field/object_frame.h"
#include "field/object_metadata.h"
#include "geometry/line_of_sight.h"
#include "geometry/matrix6.h"
#include "image/io.h"
#include "math/angle.h"
#include "recorded_sequence.h"
#include "refinement/covariance.h"
#include "runtime/shared_backend.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {
namespace {

struct Options {
  std::string model;
  std::vector<std::string> recordings;
  BackendChoice backend;
  int every = 1;
  int first_poses = 0;  // of a frame; 0: the recording is tracked
  bool reset = true, paced = false, predict = true, verbose = false;
  double start_deg = 5, start_fraction = 0.05;
  std::string initial_preset, track_preset;
};

double milliseconds(clockid_t clock) {
  timespec now;
  clock_gettime(clock, &now);
  return 1e3 * static_cast<double>(now.tv_sec) + 1e-6 * static_cast<double>(now.tv_nsec);
}

/// What was measured of the frames of one or more recordings.
struct Tally {
  std::vector<double> deg, percent, wall_ms, process_ms, squared_error;
  /// Squares of the errors by their stated variances: across and along the view, tilt and roll.
  std::array<double, 4> squared_parts = {};
  int frames = 0, right = 0, lost = 0, trusted = 0, trusted_wrong = 0;

  void add(const Tally& other) {
    const auto append = [](std::vector<double>* to, const std::vector<double>& from) {
      to->insert(to->end(), from.begin(), from.end());
    };
    append(&deg, other.deg);
    append(&percent, other.percent);
    append(&wall_ms, other.wall_ms);
    append(&process_ms, other.process_ms);
    append(&squared_error, other.squared_error);
    for (std::size_t i = 0; i < squared_parts.size(); ++i)
      squared_parts[i] += other.squared_parts[i];
    frames += other.frames;
    right += other.right;
    lost += other.lost;
    trusted += other.trusted;
    trusted_wrong += other.trusted_wrong;
  }

  void print(const std::string& name) const {
    std::printf(
        "%-28s right %.3f of %d, lost %d; trusted %.3f, wrong ones %d; median %.3f deg %.3f %%; "
        "error^2/6 %.2f; wall median %.2f p95 %.2f p99 %.2f ms; processor median %.1f mean %.1f "
        "ms\n",
        name.c_str(), static_cast<double>(right) / frames, frames, lost,
        static_cast<double>(trusted) / frames, trusted_wrong, percentile(deg, 0.5),
        percentile(percent, 0.5), mean(squared_error) / 6, percentile(wall_ms, 0.5),
        percentile(wall_ms, 0.95), percentile(wall_ms, 0.99), percentile(process_ms, 0.5),
        mean(process_ms));
    const auto of_deviation = [this](std::size_t part, int directions) {
      return std::sqrt(squared_parts[part] / std::max(1, directions * right));
    };
    std::printf(
        "%-28s errors by their stated deviations: across the view %.2f, along it %.2f; tilt %.2f, "
        "roll %.2f\n",
        "", of_deviation(0, 2), of_deviation(1, 1), of_deviation(2, 2), of_deviation(3, 1));
    std::fflush(stdout);
  }

  /// @param away from the pose found to the true one, @see cameraTwist.
  void addError(const Vector6& away, const Pose& T_O_C, const Matrix6& covariance,
                const Eigen::Vector3d& centre) {
    squared_error.push_back(std::min(100.0, squaredDistance(away, covariance)));
    const Eigen::Matrix3d sight = T_O_C.R * lineOfSightAxes(T_O_C.inverse() * centre);
    const Vector6 error = rotationOfTwists(sight).transpose() * away;
    const Vector6 variance = rotated(covariance, sight.transpose()).diagonal();
    const Vector6 squared = error.cwiseAbs2().cwiseQuotient(variance).cwiseMin(100);
    squared_parts[0] += squared[0] + squared[1];
    squared_parts[1] += squared[2];
    squared_parts[2] += squared[3] + squared[4];
    squared_parts[3] += squared[5];
  }

  static double mean(const std::vector<double>& values) {
    double sum = 0;
    for (const double value : values) sum += value;
    return sum / std::max<double>(1, static_cast<double>(values.size()));
  }
};

/// Tracks one recording.
class RecordedTracking {
 public:
  RecordedTracking(const Options& options, const std::string& folder)
      : options_(options),
        sequence_(readSequence(folder)),
        backend_(std::make_shared<SharedBackend>(makeBackend(options.backend))),
        field_(fieldWithScale(options.model)),
        frame_(ObjectFrame::inMetres(field_->metadata)),
        tracker_(backend_, field_, settingsOf(options)) {}

  /// First poses alone, each from another start as far off as a hint may be.
  Tally findFirstPoses() {
    Tally tally;
    std::mt19937_64 random(1);
    for (std::size_t i = 0; i < sequence_.frames.size(); i += options_.every) {
      const Image8 image = readImage(sequence_.frames[i].file);
      for (int k = 0; k < options_.first_poses; ++k) {
        std::uniform_real_distribution<double> uniform(-1, 1);
        Eigen::Vector3d turn, shift;
        for (int a = 0; a < 3; ++a) turn[a] = options_.start_deg * kDegree * uniform(random);
        for (int a = 0; a < 3; ++a) shift[a] = options_.start_fraction * uniform(random);
        offer(i, turn, shift);
        ++untracked_;  // an image of the same stamp would be left alone
        judge(i, time(i, image, &tally), &tally);
      }
    }
    return tally;
  }

  Tally run() {
    Tally tally;
    const auto begin = std::chrono::steady_clock::now();
    const std::int64_t first_ns = sequence_.frames.front().stamp_ns;
    const double turn = options_.start_deg * kDegree / std::sqrt(3.0);
    const double shift = options_.start_fraction / std::sqrt(3.0);
    offer(0, {turn, -turn, turn}, {-shift, shift, shift});
    for (std::size_t i = 0; i < sequence_.frames.size(); i += options_.every) {
      const RecordedFrame& frame = sequence_.frames[i];
      const Image8 image = readImage(frame.file);
      if (options_.paced) {
        std::this_thread::sleep_until(begin + std::chrono::nanoseconds(frame.stamp_ns - first_ns));
      }
      judge(i, time(i, image, &tally), &tally);
    }
    return tally;
  }

 private:
  TrackOutcome time(std::size_t i, const Image8& image, Tally* tally) {
    const double wall = milliseconds(CLOCK_MONOTONIC);
    const double process = milliseconds(CLOCK_PROCESS_CPUTIME_ID);
    const TrackOutcome outcome =
        tracker_.track({{"camera", sequence_.frames[i].stamp_ns + untracked_},
                        [&](bool) {  // without a copy, as the node's
                          return observe(viewOf(image), PixelFormat::kRgb, sequence_.camera, {});
                        }});
    tally->wall_ms.push_back(milliseconds(CLOCK_MONOTONIC) - wall);
    tally->process_ms.push_back(milliseconds(CLOCK_PROCESS_CPUTIME_ID) - process);
    return outcome;
  }

  static std::shared_ptr<const Field> fieldWithScale(const std::string& model) {
    auto field = std::make_shared<Field>(loadField(model));
    if (!(field->metadata.metres_per_unit > 0)) field->metadata.metres_per_unit = 1;
    return field;
  }

  static TrackerSettings settingsOf(const Options& options) {
    TrackerSettings settings;
    if (!options.track_preset.empty()) {
      settings.tracking = SearchSettings::named(options.track_preset, 5, 0.05);
    }
    if (!options.initial_preset.empty()) {
      settings.initial =
          SearchSettings::named(options.initial_preset, kSearchRotation_deg, kSearchTranslation);
    }
    settings.rules.predict = options.predict;
    settings.tracking.refiner.keyframes.real_time = options.paced;
    return settings;
  }

  /// The covariance of a pose from which a track would go on.
  Matrix6 covarianceOfTrack() const {
    const SearchSettings tracked = settingsOf(options_).tracking;
    const double rotation = tracked.rotation_deg * kDegree / 2;  // the search is two of them wide
    const double position = tracked.translation * diameter_m() / 2;
    Vector6 deviation;
    deviation << Eigen::Vector3d::Constant(position), Eigen::Vector3d::Constant(rotation);
    return deviation.cwiseAbs2().asDiagonal();
  }

  /// Tells the tracker a pose near that of a frame.
  /// @param turn about the object's centre, in the axes of the camera [rad]. @param shift alike
  /// [diameters]. @param covariance of the object's centre and rotation; nothing: a hint.
  void offer(std::size_t i, const Eigen::Vector3d& turn, const Eigen::Vector3d& shift,
             const std::optional<Matrix6>& covariance = std::nullopt) {
    const Pose& T_C_O = sequence_.frames[i].T_C_O;
    const Eigen::Vector3d centre =
        T_C_O * (field_->metadata.metres_per_unit * field_->metadata.centre);
    const Eigen::Matrix3d R = expSO3(turn);
    tracker_.reset();
    tracker_.offer({{R * T_C_O.R, centre + diameter_m() * shift + R * (T_C_O.t - centre)},
                    "camera",
                    covariance ? sequence_.frames[i].stamp_ns : 0,
                    false,
                    covariance});
  }

  double diameter_m() const { return field_->metadata.metres_per_unit * field_->metadata.diameter; }

  /// What looks alike is no error: turns about the axis z through the origin, if the label is
  /// hidden.
  Symmetries symmetriesAt(const RecordedFrame& frame) const {
    if (frame.label_visible) return field_->metadata.symmetries;
    return Symmetries(SymmetryAxis{Eigen::Vector3d::UnitZ(), Eigen::Vector3d::Zero()}, {});
  }

  void judge(std::size_t i, const TrackOutcome& outcome, Tally* tally) {
    const RecordedFrame& frame = sequence_.frames[i];
    const Pose truth = frame_.cameraInModel(frame.T_C_O);
    const PoseError error = poseError(outcome.refinement.T_O_C, truth, field_->metadata.centre,
                                      sequence_.camera, symmetriesAt(frame));
    const double deg = error.rotation_rad / kDegree;
    const double fraction = error.object_offset / field_->metadata.diameter;
    const bool is_right = outcome.found && deg < 5 && fraction < 0.05;
    ++tally->frames;
    tally->right += is_right;
    tally->trusted += outcome.trusted;
    tally->trusted_wrong += outcome.trusted && !is_right;
    if (is_right) {
      tally->deg.push_back(deg);
      tally->percent.push_back(100 * fraction);
      const Vector6 away = cameraTwist(outcome.refinement.T_O_C, truth, field_->metadata.centre);
      tally->addError(away, outcome.refinement.T_O_C, outcome.refinement.covariance,
                      field_->metadata.centre);
    }
    if (options_.verbose) {
      const Eigen::Vector3d centre_C = truth.inverse() * field_->metadata.centre;
      const Eigen::Vector3d found_C = outcome.refinement.T_O_C.inverse() * field_->metadata.centre;
      const double too_far = centre_C.normalized().dot(found_C - centre_C);
      const Eigen::Vector3d sight =
          (field_->metadata.centre - outcome.refinement.T_O_C.t).normalized();
      const Matrix6& covariance = outcome.refinement.covariance;
      const double along = std::sqrt(sight.dot(covariance.topLeftCorner<3, 3>() * sight));
      std::printf(
          "%3zu: %.3f deg %.3f %% (%+.3f along the view; stated %.3f), score %.3f (raw %.3f) "
          "visible %.2f %s%s\n",
          i, deg, 100 * fraction, 100 * too_far / field_->metadata.diameter,
          100 * along / field_->metadata.diameter, outcome.score,
          outcome.refinement.hypotheses.empty() ? 0.0 : outcome.refinement.hypotheses.front().score,
          outcome.refinement.visible_fraction,
          outcome.trusted ? "trusted " : outcome.message.c_str(), is_right ? "" : "WRONG");
    }
    if (is_right) return;
    ++tally->lost;
    if (options_.reset && options_.first_poses == 0)
      offer(i, {0, 0, 0}, {0, 0, 0}, covarianceOfTrack());
  }

  const Options& options_;
  RecordedSequence sequence_;
  std::shared_ptr<Backend> backend_;
  std::shared_ptr<const Field> field_;
  ObjectFrame frame_;
  ObjectTracker tracker_;
  std::int64_t untracked_ = 0;  // first poses so far
};

void addOptions(CLI::App* app, Options* options) {
  app->add_option("model", options->model, "the object's .safetensors")->required();
  app->add_option("recordings", options->recordings, "folders with sequence.json and frames/")
      ->required();
  app->add_option("--backend", options->backend.backend, "auto, cpu or cuda");
  app->add_option("--threads", options->backend.threads, "of the CPU; 0: all cores");
  app->add_option("--every", options->every, "uses every so many-th frame")
      ->check(CLI::Range(1, 1000));
  app->add_option("--first-poses", options->first_poses,
                  "so many first poses of each frame, from starts up to --start-deg and "
                  "--start-fraction off per axis, instead of tracking");
  app->add_option("--start-deg", options->start_deg, "error of the first pose");
  app->add_option("--start-fraction", options->start_fraction, "the same, of the diameter");
  app->add_option("--initial-preset", options->initial_preset, "default: the node's");
  app->add_option("--track-preset", options->track_preset, "default: the node's");
  app->add_flag("--reset,!--no-reset", options->reset, "tell the true pose where it is lost");
  app->add_flag("--predict,!--no-predict", options->predict, "follow the motion");
  app->add_flag("--paced", options->paced, "images come at their stamps, not one after another");
  app->add_flag("--verbose", options->verbose, "a line for each frame");
}

int run(int argc, char** argv) {
  CLI::App app("Tracks an object through recordings, as the node does.");
  Options options;
  addOptions(&app, &options);
  CLI11_PARSE(app, argc, argv);
  try {
    Tally all;
    for (const std::string& folder : options.recordings) {
      RecordedTracking tracking(options, folder);
      const Tally tally = options.first_poses > 0 ? tracking.findFirstPoses() : tracking.run();
      tally.print(folder.substr(folder.find_last_of('/') + 1));
      all.add(tally);
    }
    if (options.recordings.size() > 1) all.print("all");
  } catch (const std::exception& error) {
    std::fprintf(stderr, "recorded_tracking: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) { return nerf_pose_refiner::run(argc, argv); }
