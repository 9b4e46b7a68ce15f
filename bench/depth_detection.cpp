// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Looks for an object in images of recordings (recordings/README.md), each without a hint, twice:
// by colours alone and with depth (recorded_depth.h). Right: within 5 degrees and 5 % of the
// diameter, and trusted.

#include <CLI/CLI.hpp>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <memory>
#include <string>
#include <vector>

#include "backend/make_backend.h"
#include "detection/landmark_file.h"
#include "detection/object_detector.h"
#include "evaluation/pose_error.h"
#include "evaluation/statistics.h"
#include "field/object_frame.h"
#include "math/angle.h"
#include "recorded_depth.h"
#include "refinement/keyframe_refiner.h"
#include "tracking/calibrate_detector.h"
#include "trust/keyframe_scores.h"

namespace nerf_pose_refiner {
namespace {

struct Options {
  std::string model;
  std::vector<std::string> recordings;
  BackendChoice backend = {"cpu", 0, "auto", 0};
  int every = 10, first = 0;
  DetectionSettings detection;
  RecordedDepthOptions depth;
  bool verbose = false;
};

/// What came of the images of one kind.
struct Tally {
  int images = 0, right = 0, wrong = 0;
  int near = 0;        ///< a candidate was nearly right
  int used = 0;        ///< depth took part in what was found
  int from_truth = 0;  ///< would be right if alignment began at the true pose
  std::vector<double> seconds;
  DetectionTimes times;

  void print(const std::string& name) const {
    std::printf(
        "%-14s right %d of %d, wrong %d, candidates near %d, depth used %d, right from "
        "the true pose %d; %.2f s (95th %.2f), "
        "of all: features %.1f, landmarks %.1f, templates %.1f, ranking %.1f, settling %.1f s\n",
        name.c_str(), right, images, wrong, near, used, from_truth, percentile(seconds, 0.5),
        percentile(seconds, 0.95), times.features, times.landmarks, times.templates, times.ranking,
        times.settling);
    std::fflush(stdout);
  }
};

class Benchmark {
 public:
  explicit Benchmark(const Options& options)
      : options_(options),
        backend_(makeBackend(options.backend)),
        field_(backend_->load(fieldWithScale(options.model))),
        object_(field_->field().metadata),
        frame_(ObjectFrame::inMetres(object_)),
        scores_(keyframeScoresOf(backend_.get(), *field_, {})) {}

  void run() {
    for (const bool with_depth : {false, true}) {
      const auto detector = makeDetector();
      settled_ =
          std::make_unique<KeyframeRefiner>(backend_.get(), field_, options_.detection.keyframes);
      settled_->use(scores_);
      Tally tally;
      for (const std::string& folder : options_.recordings) {
        const RecordedDepth recording(options_.depth, folder, object_);
        const std::size_t count = recording.sequence().frames.size();
        for (std::size_t i = options_.first; i < count; i += options_.every) {
          look(recording, i, with_depth, detector.get(), &tally);
        }
      }
      tally.print(with_depth ? "with depth" : "colours alone");
    }
  }

 private:
  static std::shared_ptr<const Field> fieldWithScale(const std::string& model) {
    auto field = std::make_shared<Field>(loadField(model));
    if (!(field->metadata.metres_per_unit > 0)) field->metadata.metres_per_unit = 1;
    return field;
  }

  std::unique_ptr<ObjectDetector> makeDetector() {
    const DetectionModelSettings settings = options_.detection.model.adaptedTo(backend_->info());
    auto detector = std::make_unique<ObjectDetector>(
        backend_.get(), field_,
        detectionModelFor(*field_, settings, landmarkPathOf(options_.model), {}),
        options_.detection);
    calibrate(detector.get(), backend_.get(), *field_, {});
    return detector;
  }

  PoseError errorOf(const Pose& T_O_C, const RecordedDepth& recording, std::size_t i) const {
    const RecordedFrame& frame = recording.sequence().frames[i];
    const Symmetries about_z(SymmetryAxis{Eigen::Vector3d::UnitZ(), Eigen::Vector3d::Zero()}, {});
    return poseError(T_O_C, frame_.cameraInModel(frame.T_C_O), object_.centre,
                     recording.sequence().camera,
                     frame.label_visible ? object_.symmetries : about_z);
  }

  bool isRight(const Pose& T_O_C, const RecordedDepth& recording, std::size_t i) const {
    const PoseError error = errorOf(T_O_C, recording, i);
    return error.rotation_rad < 5 * kDegree && error.object_offset < 0.05 * object_.diameter &&
           options_.depth.shown.empty();
  }

  void look(const RecordedDepth& recording, std::size_t i, bool with_depth,
            ObjectDetector* detector, Tally* tally) {
    Observation observation = recording.coloursOf(i);
    if (with_depth) observation.depth = recording.depthOf(i);
    const Detections detections = detector->detect(observation, {}, {});
    ++tally->images;
    tally->seconds.push_back(detections.seconds);
    tally->times += detections.times;
    const double distance_m = recording.centreInCamera(i).norm();
    const bool is_near = std::any_of(
        detections.candidates.begin(), detections.candidates.end(), [&](const PoseCandidate& one) {
          const PoseError error = errorOf(one.T_O_C, recording, i);
          return error.rotation_rad < 16 * kDegree &&
                 error.object_offset * object_.metres_per_unit <
                     std::max(0.2 * recording.diameter_m(), 0.1 * distance_m);
        });
    tally->near += is_near;
    int right = 0;
    for (const Refinement& one : detections.found) {
      const bool is_right = isRight(one.T_O_C, recording, i);
      right += is_right;
      tally->wrong += !is_right;
      tally->used += one.depth.use == DepthUse::kUsed;
      if (options_.verbose && !is_right) printWrong(one, recording, i);
    }
    tally->right += right > 0;
    const Pose truth = frame_.cameraInModel(recording.sequence().frames[i].T_C_O);
    const Refinement settled = settled_->settle({observation, 0}, {truth}, {});
    const bool is_sure = settled.outcome == Outcome::kRefined &&
                         settled.score >= options_.detection.least_score &&
                         isRight(settled.T_O_C, recording, i);
    tally->from_truth += is_sure;
    if (!options_.verbose) return;
    std::printf("%4zu: %.2f diameters away; %s, candidates %s; from the truth %.3f; %.2f s %s\n", i,
                distance_m / recording.diameter_m(), right > 0 ? "found" : "MISSED",
                is_near ? "near" : "FAR", settled.score, detections.seconds,
                detections.message.c_str());
    std::fflush(stdout);
  }

  void printWrong(const Refinement& found, const RecordedDepth& recording, std::size_t i) const {
    const PoseError error = errorOf(found.T_O_C, recording, i);
    std::printf("WRONG: %.1f deg, %.3f diameters, score %.3f; depth: %.2f agree, %.2f farther\n",
                error.rotation_rad / kDegree, error.object_offset / object_.diameter, found.score,
                found.depth.agreeing, found.depth.farther);
  }

  const Options& options_;
  std::shared_ptr<Backend> backend_;
  std::shared_ptr<const LoadedField> field_;
  const FieldMetadata& object_;
  ObjectFrame frame_;
  KeyframeScores scores_;
  std::unique_ptr<KeyframeRefiner> settled_;
};

int run(int argc, char** argv) {
  CLI::App app("Looks for an object in recordings by colours alone and with a depth camera.");
  Options options;
  options.detection.max_instances = 1;
  app.add_option("model", options.model, "the object's .safetensors")->required();
  app.add_option("recordings", options.recordings,
                 "folders with sequence.json, frames/ and object.obj")
      ->required();
  app.add_option("--backend", options.backend.backend, "auto, cpu or cuda");
  app.add_option("--threads", options.backend.threads, "of the CPU; 0: all cores");
  app.add_option("--every", options.every, "uses every so many-th image")
      ->check(CLI::Range(1, 1000));
  app.add_option("--first", options.first, "number of the first image");
  options.depth.addTo(&app);
  app.add_flag("--verbose", options.verbose, "a line for each image");
  CLI11_PARSE(app, argc, argv);
  try {
    Benchmark(options).run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "depth_detection: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) { return nerf_pose_refiner::run(argc, argv); }
