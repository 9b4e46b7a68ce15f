// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Several cameras, and one that moves as several, on recordings of the kinds `rig` and `sweep`
// (recordings/README.md). A rig is tracked by its first camera alone, by its second one alone and
// by both; a sweep with and without a window of past views. What is stated of the cameras' places
// is wrong by as much as the options say. Frames count as in depth_tracking.

#include <CLI/CLI.hpp>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <exception>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "backend/make_backend.h"
#include "evaluation/clutter.h"
#include "evaluation/pose_error.h"
#include "evaluation/statistics.h"
#include "field/object_frame.h"
#include "field/object_metadata.h"
#include "geometry/matrix6.h"
#include "image/io.h"
#include "math/angle.h"
#include "recorded_sequence.h"
#include "refinement/sighting_log.h"
#include "runtime/shared_backend.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {
namespace {

struct Options {
  std::string model, folder;
  BackendChoice backend;
  double position_mm = 0.5, rotation_deg = 0.03, late_ms = 0;
  int cover_from = -1, cover_to = -1;  // frames in which the second camera is covered
  int window = 0;
  std::uint64_t seed = 1;
  bool calibrate = false;
  bool steady = false;  // the errors of a sweep's places are those of one hand-eye calibration
  double told = 1;      // what the window is told of them, in their deviations
  bool verbose = false;
};

/// A place that is stated a little wrongly.
Pose disturbed(const Pose& pose, const Options& options, std::mt19937_64* random) {
  std::normal_distribution<double> normal;
  const auto drawn = [&](double deviation) {
    return Eigen::Vector3d(deviation * normal(*random), deviation * normal(*random),
                           deviation * normal(*random));
  };
  const Eigen::Vector3d turn = drawn(options.rotation_deg * kDegree);
  return {nearestRotation(pose.R * expSO3(turn)),
          pose.t + pose.R * drawn(1e-3 * options.position_mm)};
}

double percentileOf(const std::vector<double>& values, double part) {
  return values.empty() ? 0 : percentile(values, part);
}

/// Errors of one way to track.
struct Tally {
  std::vector<double> along, sideways, along_second, squared_error, milliseconds, deviation, jump;
  int frames = 0, right = 0, trusted = 0, others = 0;

  void print(const std::string& name) const {
    double squared = 0;
    for (const double value : squared_error) squared += value / 6;
    std::printf(
        "%-22s right %d of %d, trusted %d; along the first view %.3f %% (95th %.3f), sideways %.3f "
        "%%; along the second view %.3f %%; error^2/6 %.2f; deviation along %.3f %%; jump 95th "
        "%.3f %%; %.2f ms; other images used %.2f a frame\n",
        name.c_str(), right, frames, trusted, percentileOf(along, 0.5), percentileOf(along, 0.95),
        percentileOf(sideways, 0.5), percentileOf(along_second, 0.5),
        squared / static_cast<double>(std::max<std::size_t>(1, squared_error.size())),
        percentileOf(deviation, 0.5), percentileOf(jump, 0.95), percentileOf(milliseconds, 0.5),
        static_cast<double>(others) / frames);
    std::fflush(stdout);
  }
};

/// Tracks by some cameras of a rig, or by the one of a sweep.
class RigTracking {
 public:
  RigTracking(const Options& options, const std::vector<RecordedSequence>& cameras, int window)
      : options_(options),
        cameras_(cameras),
        random_(options.seed),
        field_(fieldWithScale(options.model)),
        frame_(ObjectFrame::inMetres(field_->metadata)),
        tracker_(std::make_shared<SharedBackend>(makeBackend(options.backend)), field_,
                 settingsFor(options, window)) {
    for (const RecordedSequence& camera : cameras) {
      T_W_C_.push_back(disturbed(camera.frames.front().T_W_C, options_, &random_));
    }
  }

  /// States a camera's place wrongly by 5 mm and half a degree.
  void misplace(std::size_t camera) {
    const Eigen::Vector3d way = Eigen::Vector3d(0.6, -0.4, 0.7).normalized();
    T_W_C_[camera].t += 0.005 * way;
    T_W_C_[camera].R = expSO3(Eigen::Vector3d(-0.5 * kDegree * way)) * T_W_C_[camera].R;
  }

  /// Refines a camera's place from what was tracked, and tells how far off it is.
  void calibrate(std::size_t camera) const {
    const CameraCalibration found = log_.calibrate(camera, {});
    const std::vector<RecordedFrame>& first = cameras_.front().frames;
    const Pose truth = first.front().T_W_C.inverse() * cameras_[camera].frames.front().T_W_C;
    Vector6 error;
    error << found.T_C_V.t - truth.t, logSO3(Eigen::Matrix3d(found.T_C_V.R * truth.R.transpose()));
    const Vector6 deviation = found.covariance.diagonal().cwiseSqrt();
    std::printf(
        "camera %zu from %d of %zu poses: off by %.3f mm, %.4f deg (deviations up to %.3f mm, %.4f "
        "deg, error^2/6 %.2f), misfit %.2f, unseen %zu %s\n",
        camera, found.sightings, log_.size(), 1e3 * error.head<3>().norm(),
        error.tail<3>().norm() / kDegree, 1e3 * deviation.head<3>().maxCoeff(),
        deviation.tail<3>().maxCoeff() / kDegree, squaredDistance(error, found.covariance) / 6,
        found.misfit, found.unseen.size(), found.message.c_str());
  }

  void run(const RecordedSequence* second, Tally* tally) {
    tellPose(0);
    for (std::size_t i = 0; i < cameras_.front().frames.size(); ++i) {
      const Observation observation = observationOf(i);
      const auto begin = std::chrono::steady_clock::now();
      const TrackOutcome outcome = tracker_.track(
          {{"camera", cameras_.front().frames[i].stamp_ns}, [&](bool) { return observation; }});
      const std::chrono::duration<double, std::milli> spent =
          std::chrono::steady_clock::now() - begin;
      tally->milliseconds.push_back(spent.count());
      judge(i, outcome, second, tally);
    }
  }

 private:
  static std::shared_ptr<const Field> fieldWithScale(const std::string& model) {
    auto field = std::make_shared<Field>(loadField(model));
    if (!(field->metadata.metres_per_unit > 0)) field->metadata.metres_per_unit = 1;
    return field;
  }

  static TrackerSettings settingsFor(const Options& options, int window) {
    TrackerSettings settings;
    settings.tracking.refiner.keyframes.real_time = false;
    settings.window.views = window;
    settings.window.position_dev_m = 1e-3 * options.told * options.position_mm;
    settings.window.rotation_dev_deg = options.told * options.rotation_deg;
    settings.window.time_dev_s = 1e-3 * options.told * options.late_ms;
    return settings;
  }

  void tellPose(std::size_t i) {
    tracker_.reset();
    tracker_.offer({cameras_.front().frames[i].T_C_O, "camera", 0, false, {}});
  }

  bool isSweep() const { return options_.window > 0; }

  /// Where a sweep's camera is said to be: at another moment, and a little beside that.
  Pose placeInSweep(std::size_t i) {
    const std::vector<RecordedFrame>& frames = cameras_.front().frames;
    const std::size_t next = std::min(i + 1, frames.size() - 1), before = next - 1;
    const double step_s =
        1e-9 * static_cast<double>(frames[next].stamp_ns - frames[before].stamp_ns);
    const double part = 1e-3 * options_.late_ms / step_s;
    const Pose& a = frames[before].T_W_C;
    const Pose& b = frames[next].T_W_C;
    const Eigen::Matrix3d turn = expSO3(Eigen::Vector3d(part * logSO3(b.R * a.R.transpose())));
    const Pose moved(nearestRotation(turn * frames[i].T_W_C.R),
                     frames[i].T_W_C.t + part * (b.t - a.t));
    std::mt19937_64 same(options_.seed);
    return disturbed(moved, options_, options_.steady ? &same : &random_);
  }

  void cover(std::size_t i, const RecordedSequence& camera, Image8* image) const {
    const Eigen::Vector3d centre =
        camera.frames[i].T_C_O * (field_->metadata.metres_per_unit * field_->metadata.centre);
    const Eigen::Vector2d at = camera.camera.project(centre);
    const double half = 0.6 * field_->metadata.metres_per_unit * field_->metadata.diameter *
                        camera.camera.fx / centre.z();
    const Image colours = clutter(image->width, image->height, 5);
    for (int y = 0; y < image->height; ++y) {
      for (int x = 0; x < image->width; ++x) {
        if (std::abs(x - at.x()) > half || std::abs(y - at.y()) > half) continue;
        for (int c = 0; c < 3; ++c) {
          image->at(x, y, c) = static_cast<std::uint8_t>(255 * colours.at(x, y, c));
        }
      }
    }
  }

  Observation observationOf(std::size_t i) {
    const RecordedSequence& first = cameras_.front();
    Observation observation = observe(readImage(first.frames[i].file), first.camera);
    if (isSweep()) observation.T_W_C = placeInSweep(i);
    const int frame = static_cast<int>(i);
    for (std::size_t k = 1; k < cameras_.size(); ++k) {
      Image8 image = readImage(cameras_[k].frames[i].file);
      if (k == 1 && frame >= options_.cover_from && frame < options_.cover_to) {
        cover(i, cameras_[k], &image);
      }
      SideView view;
      view.observation =
          std::make_shared<const Observation>(observe(std::move(image), cameras_[k].camera));
      view.T_C_V = T_W_C_[0].inverse() * T_W_C_[k];
      // Both places are off.
      view.position_dev_m = std::sqrt(2.0) * 1e-3 * options_.position_mm;
      view.rotation_dev_rad = std::sqrt(2.0) * options_.rotation_deg * kDegree;
      observation.side_views.push_back(std::move(view));
    }
    return observation;
  }

  Symmetries symmetriesAt(const RecordedFrame& frame) const {
    if (frame.label_visible) return field_->metadata.symmetries;
    return Symmetries(SymmetryAxis{Eigen::Vector3d::UnitZ(), Eigen::Vector3d::Zero()}, {});
  }

  void remember(const Refinement& found) {
    std::vector<Pose> places;
    std::vector<std::size_t> numbers;
    for (std::size_t k = 0; k < T_W_C_.size(); ++k) {
      places.push_back(T_W_C_[0].inverse() * T_W_C_[k]);
      if (k > 0) numbers.push_back(k);
    }
    const FieldMetadata& object = field_->metadata;
    log_.add(sightingOf(found, object, numbers, places.size()), places,
             object.metres_per_unit * object.diameter);
  }

  void judge(std::size_t i, const TrackOutcome& outcome, const RecordedSequence* second,
             Tally* tally) {
    const RecordedSequence& first = cameras_.front();
    const FieldMetadata& object = field_->metadata;
    const Refinement& found = outcome.refinement;
    const Pose truth = frame_.cameraInModel(first.frames[i].T_C_O);
    const PoseError error =
        poseError(found.T_O_C, truth, object.centre, first.camera, symmetriesAt(first.frames[i]));
    const bool is_right = outcome.found && error.rotation_rad < 5 * kDegree &&
                          error.object_offset < 0.05 * object.diameter;
    ++tally->frames;
    tally->right += is_right;
    tally->trusted += outcome.trusted;
    for (const SideViewReport& report : found.side_views) tally->others += report.used;
    if (options_.calibrate && outcome.trusted) remember(found);
    const double percent = 100 / object.diameter;
    const Eigen::Vector3d true_C = truth.inverse() * object.centre;
    const Eigen::Vector3d away = found.T_O_C.inverse() * object.centre - true_C;
    const Eigen::Vector3d sight = true_C.normalized();
    const double along = away.dot(sight);
    if (options_.verbose) {
      std::printf("%3zu: along %.3f %%, sideways %.3f %%, score %.3f;", i, percent * along,
                  percent * (away - along * sight).norm(), outcome.score);
      for (const SideViewReport& report : found.side_views) {
        std::printf(" [%d %.2f %.1f %s]", report.used, report.score, report.apart,
                    report.message.c_str());
      }
      std::printf("\n");
    }
    if (!is_right) {
      last_away_.reset();
      tellPose(i);
      return;
    }
    tally->along.push_back(percent * std::abs(along));
    // Of two directions, the mean one.
    tally->sideways.push_back(percent * (away - along * sight).norm() / std::sqrt(2.0));
    if (second != nullptr) {
      const Pose T_V_C = second->frames[i].T_W_C.inverse() * first.frames[i].T_W_C;
      const Eigen::Vector3d sight_V = (T_V_C * (object.metres_per_unit * true_C)).normalized();
      tally->along_second.push_back(percent * std::abs((T_V_C.R * away).dot(sight_V)));
    }
    if (last_away_) tally->jump.push_back(percent * (away - *last_away_).norm());
    last_away_ = away;
    const Eigen::Vector3d sight_O = truth.R * sight;
    tally->deviation.push_back(
        percent * std::sqrt(sight_O.dot(found.covariance.topLeftCorner<3, 3>() * sight_O)));
    const Vector6 twist = cameraTwist(found.T_O_C, truth, object.centre);
    tally->squared_error.push_back(std::min(100.0, squaredDistance(twist, found.covariance)));
  }

  const Options& options_;
  std::vector<RecordedSequence> cameras_;
  std::mt19937_64 random_;
  std::vector<Pose> T_W_C_;  // as stated, of a rig
  std::shared_ptr<const Field> field_;
  ObjectFrame frame_;
  ObjectTracker tracker_;
  std::optional<Eigen::Vector3d> last_away_;
  SightingLog log_;
};

void trackRig(const Options& options) {
  std::vector<RecordedSequence> all;
  for (int k = 0; k < 3; ++k) {
    all.push_back(readSequence(options.folder + "/camera_" + std::to_string(k)));
  }
  Tally first, second, both, three;
  RigTracking(options, {all[0]}, 0).run(&all[1], &first);
  RigTracking(options, {all[1]}, 0).run(&all[0], &second);
  RigTracking(options, {all[0], all[1]}, 0).run(&all[1], &both);
  RigTracking(options, all, 0).run(&all[1], &three);
  first.print("first camera");
  second.print("second camera");
  both.print("first and second");
  three.print("all three");
}

/// The third camera's place is stated wrongly, the others' as the options say.
void calibrateRig(const Options& options) {
  std::vector<RecordedSequence> all;
  for (int k = 0; k < 3; ++k) {
    all.push_back(readSequence(options.folder + "/camera_" + std::to_string(k)));
  }
  RigTracking tracking(options, all, 0);
  tracking.misplace(2);
  Tally tally;
  tracking.run(&all[1], &tally);
  tally.print("all three");
  tracking.calibrate(2);
}

void trackSweep(const Options& options) {
  const RecordedSequence sweep = readSequence(options.folder);
  Tally alone, window;
  RigTracking(options, {sweep}, 0).run(nullptr, &alone);
  RigTracking(options, {sweep}, options.window).run(nullptr, &window);
  alone.print("one image");
  window.print("window");
}

void addOptions(CLI::App* app, Options* options) {
  app->add_option("model", options->model, "the object's .safetensors")->required();
  app->add_option("folder", options->folder, "a recording of the kind rig or, with --window, sweep")
      ->required();
  app->add_option("--backend", options->backend.backend, "auto, cpu or cuda");
  app->add_option("--threads", options->backend.threads, "of the CPU; 0: all cores");
  app->add_option("--window", options->window, "past views, of a sweep");
  app->add_option("--position-mm", options->position_mm, "deviation of stated places, per axis");
  app->add_option("--rotation-deg", options->rotation_deg, "the same of their rotations");
  app->add_option("--late-ms", options->late_ms, "places of a sweep are stated so much later");
  app->add_flag("--steady", options->steady, "places of a sweep have one error, not one each");
  app->add_option("--told", options->told,
                  "what the window is told of errors, in their deviations");
  app->add_option("--cover-from", options->cover_from,
                  "frame: covers the second camera from there");
  app->add_option("--cover-to", options->cover_to, "frame: uncovers it");
  app->add_option("--seed", options->seed, "of the errors");
  app->add_flag("--calibrate", options->calibrate,
                "states the third camera's place wrongly, and finds it");
  app->add_flag("--verbose", options->verbose, "a line for each frame");
}

int run(int argc, char** argv) {
  CLI::App app("Tracks an object by several cameras, or by one that moves.");
  Options options;
  addOptions(&app, &options);
  CLI11_PARSE(app, argc, argv);
  try {
    if (options.calibrate) {
      calibrateRig(options);
    } else {
      options.window > 0 ? trackSweep(options) : trackRig(options);
    }
  } catch (const std::exception& error) {
    std::fprintf(stderr, "camera_rig: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) { return nerf_pose_refiner::run(argc, argv); }
