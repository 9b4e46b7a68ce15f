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
#include "evaluation/clutter.h"
#include "evaluation/pose_error.h"
#include "evaluation/statistics.h"
#include "field/object_frame.h"
#include "field/object_metadata.h"
#include "geometry/matrix6.h"
#include "image/io.h"
#include "math/angle.h"
#include "recorded_sequence.h"
#include "rendered_depth.h"
#include "runtime/shared_backend.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {
namespace {

struct Options {
  std::string model;
  std::vector<std::string> recordings;
  BackendChoice backend;
  int every = 1, frames = 1 << 20;
  std::string fault = "none";
  bool alone = false;
  int first_poses = 0;  // of a frame; 0: the recording is tracked
  std::string shown;    // mesh that stands in the object's place; empty: the object's own
  StereoSensor sensor;
  double beside_m = 0.015;
  double cover = 0;
  bool table = false;
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
        beside_m_(shown == Shown::kDepth ? 0 : options.beside_m),
        sequence_(readSequence(folder)),
        mesh_(readMesh(options.shown.empty() ? folder + "/object.obj" : options.shown)),
        on_table_(onTable(mesh_)),
        field_(fieldFor(options.model)),
        frame_(ObjectFrame::inMetres(field_->metadata)),
        tracker_(std::make_shared<SharedBackend>(makeBackend(options.backend)), field_,
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
  /// Depth does not show the label: the bottle is told to be symmetric where depth is alone.
  std::shared_ptr<const Field> fieldFor(const std::string& model) const {
    auto field = std::make_shared<Field>(loadField(model));
    FieldMetadata& object = field->metadata;
    if (!(object.metres_per_unit > 0)) object.metres_per_unit = 1;
    const auto hides_label = [](const RecordedFrame& frame) { return !frame.label_visible; };
    const bool has_label =
        std::any_of(sequence_.frames.begin(), sequence_.frames.end(), hides_label);
    if (has_label && shown_ == Shown::kDepth) object.symmetries = aboutZ();
    return field;
  }

  static Symmetries aboutZ() {
    return Symmetries(SymmetryAxis{Eigen::Vector3d::UnitZ(), Eigen::Vector3d::Zero()}, {});
  }

  static TrackerSettings settingsFromFile() {
    TrackerSettings settings;
    settings.tracking.refiner.keyframes.real_time = false;
    return settings;
  }

  /// The object on a table, in which its axis z stands upright.
  static TriangleMesh onTable(TriangleMesh mesh) {
    constexpr double kHalfSide_m = 0.5;
    double z = 1e9;
    for (const Eigen::Vector3d& p : mesh.points) z = std::min(z, p.z());
    const int first = static_cast<int>(mesh.points.size());
    for (const double x : {-kHalfSide_m, kHalfSide_m}) {
      for (const double y : {-kHalfSide_m, kHalfSide_m}) mesh.points.emplace_back(x, y, z);
    }
    mesh.triangles.push_back({first, first + 1, first + 2});
    mesh.triangles.push_back({first + 1, first + 2, first + 3});
    return mesh;
  }

  /// Seen from below, there is no table.
  const TriangleMesh& meshAt(const Pose& T_D_O) const {
    constexpr double kLowest = 0.2;  // sine of the elevation
    const Eigen::Vector3d eye = T_D_O.inverse().t;
    return options_.table && eye.z() > kLowest * eye.norm() ? on_table_ : mesh_;
  }

  double diameter_m() const { return field_->metadata.metres_per_unit * field_->metadata.diameter; }

  Eigen::Vector3d centreInCamera(std::size_t i) const {
    return sequence_.frames[i].T_C_O * (field_->metadata.metres_per_unit * field_->metadata.centre);
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
    for (int a = 0; a < 3; ++a) shift[a] = kSearchTranslation * diameter_m() * uniform(random_);
    const Pose& T_C_O = sequence_.frames[i].T_C_O;
    const Eigen::Vector3d centre = centreInCamera(i);
    const Eigen::Matrix3d R = expSO3(turn);
    tracker_.reset();
    tracker_.offer(
        {{R * T_C_O.R, centre + shift + R * (T_C_O.t - centre)}, "camera", 0, false, {}});
  }

  void tellPose(std::size_t i) {
    tracker_.reset();
    tracker_.offer({sequence_.frames[i].T_C_O, "camera", 0, false, {}});
  }

  /// A card before one side of the object, of the part of its width that is to be covered.
  DepthSurroundings surroundings(std::size_t i, const Camera& camera, const Pose& T_C_D) const {
    DepthSurroundings around;
    const Eigen::Vector3d centre_D = T_C_D.inverse() * centreInCamera(i);
    around.wall_m = std::max(around.wall_m, centre_D.z() + 2 * diameter_m());
    if (!(options_.cover > 0)) return around;
    around.card_m = centre_D.z() - 0.6 * diameter_m();
    const Eigen::Vector2d at = camera.project(centre_D);
    const double half_px = 0.5 * diameter_m() * camera.fx / centre_D.z();
    const int left = static_cast<int>(at.x() - half_px);
    around.card = {left, static_cast<int>(at.y() - half_px),
                   static_cast<int>(2 * options_.cover * half_px), static_cast<int>(2 * half_px)};
    return around;
  }

  std::shared_ptr<const DepthImage> depthOf(std::size_t i) {
    constexpr std::size_t kLate = 2;
    const Pose T_C_D(Eigen::Matrix3d::Identity(), {beside_m_, 0, 0});
    const bool late = options_.fault == "late", other = options_.fault == "other";
    const std::size_t shown = late && i >= kLate ? i - kLate
                              : other            ? (i + 97) % sequence_.frames.size()
                                                 : i;
    const Camera& camera = sequence_.camera;
    std::mt19937_64 random(1000 + shown);
    const Pose T_D_O = T_C_D.inverse() * sequence_.frames[shown].T_C_O;
    ImageOf<float> metres =
        stereoDepth(trueDepth(meshAt(T_D_O), T_D_O, camera, surroundings(shown, camera, T_C_D)),
                    camera, options_.sensor, &random);
    const double scale = options_.fault == "zero"          ? 0
                         : options_.fault == "millimetres" ? 1000
                         : options_.fault == "scale"       ? 1.1
                                                           : 1;
    for (float& value : metres.values) value *= static_cast<float>(scale);
    return depthImage(std::move(metres), camera, T_C_D);
  }

  Observation observationOf(std::size_t i) {
    if (shown_ == Shown::kDepth) return observe(depthOf(i));
    Image8 image = readImage(sequence_.frames[i].file);
    if (options_.cover > 0) {
      const DepthSurroundings around = surroundings(i, sequence_.camera, {});
      const Image colours = clutter(image.width, image.height, 3);
      const PixelWindow& card = around.card;
      for (int y = std::max(0, card.y); y < std::min(image.height, card.y + card.height); ++y) {
        for (int x = std::max(0, card.x); x < std::min(image.width, card.x + card.width); ++x) {
          for (int c = 0; c < 3; ++c) {
            image.at(x, y, c) = static_cast<std::uint8_t>(255 * colours.at(x, y, c));
          }
        }
      }
    }
    Observation observation = observe(std::move(image), sequence_.camera);
    if (shown_ == Shown::kColoursAndDepth) observation.depth = depthOf(i);
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
    const bool is_right = outcome.found && deg < 5 && fraction < 0.05 && options_.shown.empty();
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
  const double beside_m_;
  RecordedSequence sequence_;
  TriangleMesh mesh_, on_table_;
  std::shared_ptr<const Field> field_;
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
  app->add_option("--fault", options->fault, "of the depth")
      ->check(CLI::IsMember({"none", "zero", "millimetres", "scale", "late", "other"}));
  app->add_option("--noise-m", options->sensor.noise_m, "of a pixel at 0.6 m");
  app->add_option("--holes", options->sensor.holes, "fraction of the image");
  app->add_option("--bias-px", options->sensor.bias_px, "of disparity");
  app->add_option("--cover", options->cover, "fraction of the object behind a card");
  app->add_flag("--alone", options->alone, "depth alone, without colours");
  app->add_option("--first-poses", options->first_poses,
                  "so many first poses of each frame, from starts up to 15 degrees and 15 % of the "
                  "diameter off per axis, instead of tracking");
  app->add_flag("--table", options->table, "the object stands on a table, where seen from above");
  app->add_option("--shown", options->shown,
                  "a mesh that depth shows in the object's place: no pose is right then");
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
      depth.print("depth alone, fault: " + options.fault);
      return 0;
    }
    Tally colours, with;
    for (const std::string& folder : options.recordings) {
      DepthTracking(options, folder, Shown::kColours).run(&colours);
      DepthTracking(options, folder, Shown::kColoursAndDepth).run(&with);
    }
    colours.print("colours alone");
    with.print("with depth, fault: " + options.fault);
  } catch (const std::exception& error) {
    std::fprintf(stderr, "depth_tracking: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) { return nerf_pose_refiner::run(argc, argv); }
