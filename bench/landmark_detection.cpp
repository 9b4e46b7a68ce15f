// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Looks for an object in whole images without a hint, and says at which stage it is lost where it
// is not found: features, matches, votes, poses, alignment, score or the order of candidates.

#include <CLI/CLI.hpp>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <exception>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "backend/common/observed_colours.h"
#include "backend/loaded_field.h"
#include "backend/make_backend.h"
#include "concurrency/seconds_since.h"
#include "dataset/dataset.h"
#include "detection/landmark_file.h"
#include "detection/object_detector.h"
#include "evaluation/pose_error.h"
#include "evaluation/statistics.h"
#include "evaluation/trial_observation.h"
#include "field/object_metadata.h"
#include "math/angle.h"
#include "refinement/keyframe_refiner.h"
#include "trust/keyframe_scores.h"

namespace nerf_pose_refiner {
namespace {

struct Options {
  std::string model, data;
  std::vector<std::string> conditions = {"placed"};
  std::string training;  // data; empty: landmarks of renderings alone
  bool only_photos = false;
  std::vector<std::string> photos;
  BackendChoice backend = {"cpu", 0, "auto", 0};
  int every = 1, first = 0, seeds = 1;
  DetectionSettings detection = alone();

  static DetectionSettings alone() {
    DetectionSettings settings;
    settings.max_instances = 1;
    return settings;
  }
};

/// An image and where its camera was.
struct Scene {
  Observation observation;
  Pose T_O_C;
  double width;  ///< of the object's diameter, of the image's
};

/// What became of the object up to the candidates.
struct Evidence {
  int features = 0, matches = 0;
  int right_matches = 0;  ///< landmarks that lie where their feature is
  int right_votes = 0;    ///< of those, votes that agree with the truth
  int right_group = 0;    ///< of all votes, those that agree with the truth
};

class Benchmark {
 public:
  explicit Benchmark(const Options& options)
      : options_(options),
        backend_(makeBackend(options.backend)),
        field_(backend_->load(std::make_shared<const Field>(loadField(options.model)))),
        object_(field_->field().metadata),
        model_(makeModel()),
        landmarks_(model_.landmarks),
        matcher_(backend_.get(), landmarks_, object_, options.detection.matching),
        scores_(keyframeScoresOf(backend_.get(), *field_, {})),
        detector_(backend_.get(), field_, model_, options.detection),
        settled_(backend_.get(), field_, options.detection.keyframes),
        is_same_instance_(field_->field()) {
    detector_.use(scores_);
    settled_.use(scores_);
  }

  void run() {
    std::printf("%d landmarks%s\n", landmarks_.size(), model_.templates ? ", templates" : "");
    const Dataset dataset = loadDataset(options_.data);
    for (const std::string& condition : options_.conditions) {
      run(dataset, condition);
      std::printf("%s: ", condition.c_str());
      report();
    }
  }

 private:
  void run(const Dataset& dataset, const std::string& condition) {
    for (int seed = 1; seed <= options_.seeds; ++seed) {
      TrialObservation how = TrialObservation::named(condition, "alpha");
      how.photos = options_.photos;
      how.seed = static_cast<std::uint64_t>(seed);
      for (std::size_t i = options_.first; i < dataset.views.size(); i += options_.every) {
        const TrialImage image = how.imageOf(dataset.views, i);
        const PosedView& view = image.view;
        const Detections found = detector_.detect(image.observation, {}, {});
        seconds_.push_back(found.seconds);
        times_ += found.times;
        for (const ShownInstance& one : image.instances) {
          const double distance = (one.T_O_C.t - object_.centre).norm() / object_.diameter;
          const double width = view.camera.fx / view.camera.width / distance;
          std::printf("%d/%-3zu width %.2f visible %.2f", seed, i, width, one.visible);
          look({image.observation, one.T_O_C, width}, found);
        }
        if (image.instances.empty()) absent(found);
      }
    }
  }

  DetectionModel makeModel() const {
    const DetectionModelSettings settings = options_.detection.model.adaptedTo(backend_->info());
    const std::string path = landmarkPathOf(options_.model);
    if (options_.training.empty()) return detectionModelFor(*field_, settings, path, {});
    std::vector<LandmarkPhoto> photos;
    for (const PosedView& view : loadDataset(options_.training).views) {
      photos.push_back({view.rgba, {view.camera, view.T_O_C}});
    }
    const auto begin = std::chrono::steady_clock::now();
    if (options_.only_photos) {
      LandmarkMerger merger(settings.landmarks, object_.diameter);
      for (const LandmarkPhoto& photo : photos) {
        merger.add(landmarksOf(photo, *field_, settings.landmarks, {}));
      }
      saveLandmarks(merger.best(), landmarkKey(field_->field(), settings.landmarks), path);
    } else {
      makeDetectionModel(*field_, photos, settings, path, {});
    }
    std::printf("made in %.1f s\n", secondsSince(begin));
    return detectionModelFor(*field_, settings, path, {});
  }

  void absent(const Detections& found) {
    ++stages_[found.found.empty() ? "nothing" : "WRONG"];
    for (const Refinement& one : found.found) {
      std::printf("[chroma %.3f] ", one.chromatic_difference.value_or(-1));
    }
    std::printf("%s in %.2f s\n", found.found.empty() ? "nothing" : "WRONG", found.seconds);
  }

  /// The one of an instance; null: there is none.
  const Refinement* poseOf(const Scene& trial, const Detections& found) const {
    for (const Refinement& one : found.found) {
      if (is_same_instance_(one.T_O_C, trial.T_O_C)) return &one;
    }
    return nullptr;
  }

  void look(const Scene& trial, const Detections& found) {
    const Evidence evidence = evidenceIn(trial);
    const Refinement* const pose = poseOf(trial, found);
    const bool is_published = pose != nullptr;
    const bool is_right = is_published && isRight(pose->T_O_C, trial);
    std::string stage = is_right ? "found" : is_published ? "WRONG" : "";
    int rank = -1;
    Refinement settled;
    if (!is_right) settled = settleNear(found.candidates, trial, &rank);
    if (!is_right && rank < 0 && model_.templates) {
      const PoseCandidates before = detector_.templateCandidates(trial.observation, {}, {});
      int first = -1;
      settleNear(before, trial, &first);
      std::printf(" [before ranking %d of %zu]", first, before.size());
    }
    if (stage.empty()) stage = stageOf(evidence, rank, settled, trial);
    ++stages_[stage];
    if (!found.candidates.empty()) std::printf(" [first %.2f]", found.candidates[0].evidence);
    std::printf(": %4d features, %4d matches, %3d right, %3d vote right of %3d, rank %2d of %zu, ",
                evidence.features, evidence.matches, evidence.right_matches, evidence.right_votes,
                evidence.right_group, rank, found.candidates.size());
    if (is_published) {
      describe(*pose, trial);
    } else if (rank >= 0) {
      describe(settled, trial);
    }
    if (!is_right) {
      std::printf(" from truth ");
      describe(settled_.settle({trial.observation, 0}, {trial.T_O_C}, {}), trial);
    }
    std::printf(" %.2f s: %s\n", found.seconds, stage.c_str());
    std::fflush(stdout);
  }

  Evidence evidenceIn(const Scene& trial) const {
    Evidence evidence;
    FeatureSettings settings = options_.detection.features;
    settings.kind = landmarks_.kind;
    const Camera& camera = trial.observation.camera;
    const ImageFeatures features =
        findFeatures(luminance(observedColours(trial.observation)), {}, settings);
    evidence.features = features.size();
    const auto truth = voteFor(trial.T_O_C, camera, object_);
    if (!truth) return evidence;
    const double near = std::max(1.5, 0.02 * truth->diameter_px);
    for (const FeatureMatch& match : matcher_.match(features)) {
      if (match.rank > 0 || match.ratio > options_.detection.candidates.max_ratio) continue;
      ++evidence.matches;
      const FeaturePlace& feature = features.places[static_cast<std::size_t>(match.feature)];
      const Landmark& landmark = landmarks_.places[static_cast<std::size_t>(match.landmark)];
      const Eigen::Vector2d seen =
          camera.project(trial.T_O_C.inverse() * landmark.point.cast<double>());
      const bool is_right = (seen - Eigen::Vector2d(feature.x, feature.y)).norm() < near;
      const auto vote = voteFor(poseFromMatch(camera, feature, landmark), camera, object_);
      const bool votes = vote && agree(*vote, *truth, options_.detection.candidates.votes);
      evidence.right_matches += is_right;
      evidence.right_votes += is_right && votes;
      evidence.right_group += votes;
    }
    return evidence;
  }

  /// From the first candidate that is nearly right.
  Refinement settleNear(const PoseCandidates& candidates, const Scene& trial, int* rank) {
    constexpr double kRotation = 16 * kDegree, kOffset = 0.2;  // [diameters]
    for (std::size_t i = 0; i < candidates.size(); ++i) {
      const PoseError error = errorOf(candidates[i].T_O_C, trial);
      if (error.rotation_rad > kRotation || error.object_offset > kOffset * object_.diameter) {
        continue;
      }
      *rank = static_cast<int>(i);
      std::printf(" [evidence %.2f, %.1f deg, %.1f %%]", candidates[i].evidence,
                  error.rotation_rad / kDegree, 100 * error.object_offset / object_.diameter);
      return settled_.settle({trial.observation, 0}, {candidates[i].T_O_C}, {});
    }
    return {};
  }

  std::string stageOf(const Evidence& evidence, int rank, const Refinement& settled,
                      const Scene& trial) const {
    const int least = options_.detection.candidates.least_landmarks;
    if (rank < 0 && model_.templates) return "lost: candidates";
    if (evidence.right_matches < least) return "lost: matches";
    if (evidence.right_votes < least) return "lost: votes";
    if (rank < 0) return "lost: poses";
    if (!isRight(settled.T_O_C, trial)) return "lost: alignment";
    return settled.score < options_.detection.least_score ? "lost: score" : "lost: order";
  }

  void describe(const Refinement& refined, const Scene& trial) const {
    const PoseError error = errorOf(refined.T_O_C, trial);
    const double raw = refined.hypotheses.empty() ? 0 : refined.hypotheses.front().score;
    std::printf("[chroma %.3f] ", refined.chromatic_difference.value_or(-1));
    std::printf("%s %.2f (by image %.2f, raw %.2f, visible %.2f), %.2f deg, %.1f %%",
                isRight(refined.T_O_C, trial) ? "right" : "wrong", refined.score,
                refined.found_probability.value_or(0), raw, refined.visible_fraction,
                error.rotation_rad / kDegree, 100 * error.object_offset / object_.diameter);
  }

  PoseError errorOf(const Pose& T_O_C, const Scene& trial) const {
    return poseError(T_O_C, trial.T_O_C, object_.centre, trial.observation.camera,
                     object_.symmetries);
  }

  bool isRight(const Pose& T_O_C, const Scene& trial) const {
    const PoseError error = errorOf(T_O_C, trial);
    return error.rotation_rad < 5 * kDegree && error.object_offset < 0.05 * object_.diameter;
  }

  void report() {
    int images = 0;
    for (const auto& [stage, count] : stages_) images += count;
    for (const auto& [stage, count] : stages_) {
      std::printf("%s %d of %d; ", stage.c_str(), count, images);
    }
    stages_.clear();
    std::printf("median %.3f s, p95 %.3f s", percentile(seconds_, 0.5), percentile(seconds_, 0.95));
    const double searches = static_cast<double>(seconds_.size());
    std::printf(
        "; means: features %.3f s, landmarks %.3f s, templates %.3f s, ranking %.3f s, settling "
        "%.3f s\n",
        times_.features / searches, times_.landmarks / searches, times_.templates / searches,
        times_.ranking / searches, times_.settling / searches);
  }

  Options options_;
  std::unique_ptr<Backend> backend_;
  std::shared_ptr<const LoadedField> field_;
  const FieldMetadata& object_;
  DetectionModel model_;
  const Landmarks& landmarks_;
  LandmarkMatcher matcher_;
  KeyframeScores scores_;
  ObjectDetector detector_;
  KeyframeRefiner settled_;
  SameInstance is_same_instance_;
  std::map<std::string, int> stages_;
  std::vector<double> seconds_;
  DetectionTimes times_;
};

void addOptions(CLI::App* app, Options* o) {
  app->add_option("model", o->model, "the object's .safetensors")->required();
  app->add_option("data", o->data, "a dataset's transforms.json")->required();
  app->add_option("--training", o->training,
                  "photos whose features are landmarks, too; these are saved");
  app->add_flag("--only-photos", o->only_photos, "no landmarks of renderings");
  app->add_option("--condition", o->conditions, "as those of the experiments");
  app->add_option("--photos", o->photos,
                  "one is drawn, to be put behind a view; none: drawn clutter");
  app->add_option("--first", o->first, "number of the first view");
  app->add_option("--every", o->every, "only every so many-th view");
  app->add_option("--seeds", o->seeds, "so often each view, in other places");
  app->add_option("--backend", o->backend.backend, "cpu or cuda")->capture_default_str();
  app->add_option("--threads", o->backend.threads, "of the CPU; 0: all cores");
  app->add_option("--ratio", o->detection.candidates.max_ratio, "of matches that vote, at most");
  app->add_option("--features", o->detection.features.max_features, "of an image, at most");
  app->add_option("--single", o->detection.candidates.most_single, "poses of single matches");
  app->add_option("--groups", o->detection.candidates.most_groups, "of votes");
  app->add_option("--candidates", o->detection.candidates.most_candidates, "at most");
  app->add_option("--landmarks", o->detection.candidates.least_landmarks, "that agree");
  app->add_option("--score", o->detection.least_score, "of what is published");
  app->add_option("--plain", o->detection.model.plain_landmarks,
                  "objects with fewer landmarks get templates");
  app->add_option("--scanned", o->detection.templates.matching.scanned_px,
                  "width of plain objects [px]");
  app->add_option("--ranked", o->detection.max_ranked, "candidates of plain objects");
  app->add_option("--first-look", o->detection.first_look_side_px,
                  "side of the reduced image that is looked at first [px]; 0: none");
  app->add_option("--instances", o->detection.max_instances, "looked for in an image");
  app->add_option("--tried", o->detection.max_tried, "candidates, in a row");
}

int run(int argc, char** argv) {
  CLI::App app("Says at which stage an object is lost that is looked for by landmarks.");
  Options options;
  addOptions(&app, &options);
  CLI11_PARSE(app, argc, argv);
  try {
    Benchmark(options).run();
  } catch (const std::exception& error) {
    std::fprintf(stderr, "landmark_detection: %s\n", error.what());
    return 1;
  }
  return 0;
}

}  // namespace
}  // namespace nerf_pose_refiner

int main(int argc, char** argv) { return nerf_pose_refiner::run(argc, argv); }
