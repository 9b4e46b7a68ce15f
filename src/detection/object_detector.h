// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <chrono>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "detection/candidate.h"
#include "detection/candidate_ranking.h"
#include "detection/detection_model.h"
#include "detection/landmark_candidates.h"
#include "detection/landmark_matcher.h"
#include "detection/same_instance.h"
#include "detection/search_area.h"
#include "detection/template_search.h"
#include "nerf_pose_refiner/observation.h"
#include "refinement/keyframe_refiner.h"

namespace nerf_pose_refiner {

/// How an object is detected.
struct DetectionSettings {
  DetectionModelSettings model;
  FeatureSettings features = {bestFeatureKind(), 8000};  ///< of images, clutter and all
  MatchingSettings matching;
  LandmarkCandidateSettings candidates;
  TemplateSearchSettings templates;
  KeyframeSearchSettings keyframes;
  int max_ranked = 12;          ///< of the candidates by templates, after their ranking
  int max_ranked_single = 6;    ///< of the poses of single matches, after their ranking
  int max_image_side_px = 800;  ///< larger images are reduced to it for their features
  /// Where one instance of a textured object is enough (max_instances 1), it is looked for in an
  /// image that is reduced to this first; 0: it is not.
  int first_look_side_px = 400;
  int glance_side_px = 200;  ///< largest side of keyframes in glances
  int max_instances = 10;    ///< that are returned
  int max_tried_beside = 2;  ///< the same once they have led to an instance: others are as clear
  int max_at_once = 4;       ///< candidates of one place that are aligned
  int max_tried = 6;         ///< candidates in a row that alignment refuses end the search
  double least_score = 0.9;  ///< probability of a pose to be trusted, 0..1
  double budget_s = 0;       ///< after it what was found until then counts; 0: no limit

  /// @throws std::invalid_argument naming the value that is out of range.
  void validate() const;
};

/// What an object is looked for by. All but the first are glances, which take a fraction of the
/// time: half as many candidates are tried, too, and of each place the best one alone.
enum class DetectionCues {
  kAll,
  kFirstLook,          ///< as kAgreeingLandmarks, but of a reduced image where that saves time
  kAgreeingLandmarks,  ///< several of which lead to the same pose
  kLandmarks,          ///< and single ones
  kTemplates,          ///< alone; finds nothing of an object that has none
};

/// What the parts of a search took [s].
struct DetectionTimes {
  double features = 0;   ///< of the image, also to wait for another detector that finds them
  double landmarks = 0;  ///< matches and the candidates that they lead to
  double templates = 0;  ///< their candidates
  double ranking = 0;    ///< of candidates by small views
  double settling = 0;   ///< alignment of the best ones, and whether they are trusted

  DetectionTimes& operator+=(const DetectionTimes& other) {
    features += other.features;
    landmarks += other.landmarks;
    templates += other.templates;
    ranking += other.ranking;
    settling += other.settling;
    return *this;
  }
};

/// Poses that landmarks speak for.
struct ImageCandidates {
  PoseCandidates poses;                 ///< best first
  std::string message;                  ///< why there is none; empty if there is one
  std::optional<MatchedImage> matched;  ///< what of the image looks like landmarks
  DetectionTimes times;                 ///< of features and landmarks
};

/// What came of an image.
struct Detections {
  std::vector<Refinement> found;  ///< trusted poses of instances, best first
  std::string message;            ///< why there is none; empty if there is one
  PoseCandidates candidates;      ///< that landmarks or templates spoke for, best first
  double seconds = 0;             ///< all in all
  DetectionTimes times;
};

/// Finds the instances of an object in images, without a hint of where they are.
///
/// Not thread-safe. What its backend made may be used by others meanwhile, but only in turns with
/// its renderings (@see SharedBackend).
class ObjectDetector {
 public:
  /// @param model of the field. @throws std::invalid_argument for settings that are out of range.
  ObjectDetector(Backend* backend, std::shared_ptr<const LoadedField> field, DetectionModel model,
                 const DetectionSettings& settings);

  /// @param trust_score a pose that is less likely right is no detection, 0..1.
  void setTrustScore(double trust_score) { settings_.least_score = trust_score; }

  /// Judges poses by these scores, in place of the object's own.
  void use(const KeyframeScores& scores);

  /// Tells poses apart that look like these, in place of the object's own.
  void use(const LookAlikes& look_alikes);

  /// Whether its landmarks are too few: it is looked for by templates in each image. (Those of a
  /// textured object are tried where nothing else finds it.)
  bool isPlain() const { return is_plain_; }

  /// Poses that landmarks speak for, in the part of the image that the area and the observation's
  /// mask leave. @throws as `detect`.
  ImageCandidates candidates(const Observation& observation, const SearchArea& area,
                             const CancellationToken& cancellation) const;

  /// Makes a pose that was found without landmarks likelier by those that agree with it.
  /// @param matched of the same image.
  void weigh(const MatchedImage& matched, Refinement* pose) const;

  /// Poses that templates speak for, in the same part; none without templates.
  /// @param by_depth at each distance only in what the observation's depth shows there; none where
  /// it shows nothing. @throws as `detect`.
  PoseCandidates templateCandidates(const Observation& observation, const SearchArea& area,
                                    const CancellationToken& cancellation, bool by_depth = false);

  /// Looks in the observation's boxes, if it has some: one after the other, until there are as many
  /// instances as are asked for.
  /// @throws std::invalid_argument for an observation that makes no sense, Cancelled.
  Detections detect(const Observation& observation, const SearchArea& area,
                    const CancellationToken& cancellation,
                    DetectionCues cues = DetectionCues::kAll);

 private:
  struct Search;

  ImageCandidates candidatesAt(int max_side_px, const Observation& observation,
                               const SearchArea& area, const CancellationToken& cancellation) const;
  double oddsAt(const Pose& T_O_C, const MatchedImage& matched) const;
  PoseCandidates atDistance(const SearchArea& area, PoseCandidates candidates) const;
  PoseCandidates ranked(PoseCandidates candidates, int most, Search* search);
  PoseCandidates singleMatches(const MatchedImage& matched, const SearchArea& area, Search* search);
  KeyframeRefiner& refinerFor(const Search& search);
  Refinement takeBest(ImageCandidates* candidates, const Search& search);
  void settleAll(ImageCandidates* candidates, Search* search);
  void detectIn(const SearchArea& area, Search* search);
  std::optional<int> firstLookSide_px(const PixelWindow& window) const;
  bool findAtFirstLook(int side_px, const SearchArea& area, Search* search);
  ImageCandidates findByLandmarks(const SearchArea& area, Search* search);
  void settleFrom(PoseCandidates poses, ImageCandidates* all, Search* search);
  void findByTemplates(const SearchArea& area, ImageCandidates* all, Search* search);

  Backend* backend_;
  std::shared_ptr<const LoadedField> field_;
  DetectionSettings settings_;
  bool is_plain_;
  std::unique_ptr<const Landmarks> landmarks_;  // the matcher points at them
  LandmarkMatcher matcher_;
  std::optional<KeyframeScores> scores_;   // nothing: the object's own
  std::optional<LookAlikes> look_alikes_;  // the same
  KeyframeRefiner refiner_;
  std::optional<KeyframeRefiner> glancing_;  // made when it is needed first
  SameInstance is_same_instance_;
  std::optional<TemplateSearch> templates_;
  std::optional<CandidateRanking> ranking_;  // made when it is needed first
};
/// Whether a likelier pose of the same place was refused because the image does not say exactly
/// enough where it is: then this one is no surer, whatever its own covariance says.
/// @param doubted poses that were found but not trusted.
bool isOutdone(const Refinement& pose, const std::vector<Refinement>& doubted,
               const SameInstance& is_same_instance);

}  // namespace nerf_pose_refiner
