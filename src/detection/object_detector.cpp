// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/object_detector.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "backend/common/observed_colours.h"
#include "concurrency/seconds_since.h"
#include "field/field.h"
#include "image/resample.h"
#include "math/require.h"
#include "refinement/pose_probability.h"

namespace nerf_pose_refiner {
namespace {

/// What landmarks that agree with a pose say for it. Chance makes as few agree as are asked for; of
/// the candidates in images without the object, each further one halves the number.
/// @param further landmarks than are asked for.
double oddsOfLandmarks(double further) {
  constexpr double kMax = 20;  // the image has to agree, too: parts of objects look alike
  return std::min(kMax, std::exp2(std::max(0.0, further)));
}

/// Distances at which the object may be [diameters].
DistanceRange distancesIn(const SearchArea& area, const Camera& part, double diameter) {
  constexpr double kNearest = 0.8;
  DistanceRange range = DistanceRange::usual(part);
  if (area.distance) {
    const double distance = *area.distance / diameter;
    range = {std::max(kNearest, distance / SearchArea::kDistanceRatio),
             std::max(kNearest, distance * SearchArea::kDistanceRatio)};
  }
  return range;
}

bool isAllowed(const Image8& allowed, const Camera& part, const Eigen::Vector3d& centre_C) {
  if (allowed.empty()) return true;
  const Eigen::Vector2d pixel = part.project(centre_C);
  const long x = std::lround(pixel.x()), y = std::lround(pixel.y());
  return x >= 0 && y >= 0 && x < allowed.width && y < allowed.height &&
         allowed.at(static_cast<int>(x), static_cast<int>(y), 0) > 0;
}

}  // namespace

void DetectionSettings::validate() const {
  model.validate();
  require(features.max_features >= 1, "DetectionSettings::features.max_features",
          features.max_features);
  require(candidates.least_landmarks >= 4, "DetectionSettings::candidates.least_landmarks",
          candidates.least_landmarks);
  require(max_image_side_px >= 32, "DetectionSettings::max_image_side_px", max_image_side_px);
  require(max_instances >= 1, "DetectionSettings::max_instances", max_instances);
  require(max_tried >= 1, "DetectionSettings::max_tried", max_tried);
  require(max_ranked >= 1, "DetectionSettings::max_ranked", max_ranked);
  require(max_at_once >= 1, "DetectionSettings::max_at_once", max_at_once);
  require(max_tried_beside >= 1, "DetectionSettings::max_tried_beside", max_tried_beside);
  require(least_score >= 0 && least_score <= 1, "DetectionSettings::least_score", least_score);
  require(budget_s >= 0, "DetectionSettings::budget_s", budget_s);
}

ObjectDetector::ObjectDetector(Backend* backend, std::shared_ptr<const LoadedField> field,
                               DetectionModel model, const DetectionSettings& settings)
    : backend_(backend),
      field_(std::move(field)),
      settings_(settings),
      landmarks_(std::make_unique<const Landmarks>(std::move(model.landmarks))),
      matcher_(*landmarks_, field_->field().metadata.diameter, settings.matching),
      refiner_(backend, field_, settings.keyframes) {
  settings_.validate();
  if (model.templates) {
    templates_.emplace(std::move(model.templates), field_->field().metadata, settings.templates);
  }
}

ImageCandidates ObjectDetector::candidates(const Observation& observation, const SearchArea& area,
                                           const CancellationToken& cancellation) const {
  ImageCandidates result;
  const std::optional<Camera> part =
      searchedPart(observation.camera, area, settings_.max_image_side_px);
  if (!part) {
    result.message = "the box leaves too little of the image";
    return result;
  }
  const bool is_whole =
      part->width == observation.camera.width && part->height == observation.camera.height;
  FeatureSettings settings = settings_.features;
  settings.kind = landmarks_->kind;
  const Image colours = observedColours(observation);
  const ImageFeatures features =
      findFeatures(luminance(is_whole ? colours : resample(colours, observation.camera, *part)),
                   allowedPixels(observation, *part), settings);
  cancellation.check();
  result.matched.emplace(
      MatchedImage{*part, features.places, *landmarks_, matcher_.match(features)});
  const FieldMetadata& object = field_->field().metadata;
  for (const PoseCandidate& candidate :
       landmarkCandidates(*result.matched, object, settings_.candidates, cancellation)) {
    if (isAtDistance(area, (candidate.T_O_C.t - object.centre).norm())) {
      result.poses.push_back(candidate);
    }
  }
  if (features.size() == 0) {
    result.message = "the image has no features";
  } else if (result.poses.empty()) {
    result.message = "no pose agrees with enough landmarks";
  }
  return result;
}

PoseCandidates ObjectDetector::templateCandidates(const Observation& observation,
                                                  const SearchArea& area,
                                                  const CancellationToken& cancellation) const {
  const std::optional<Camera> part =
      searchedPart(observation.camera, area, settings_.max_image_side_px);
  if (!part || !templates_) return {};
  const FieldMetadata& object = field_->field().metadata;
  const Image colours = observedColours(observation);
  const TemplateFindings findings =
      templates_->find(resample(colours, observation.camera, *part), *part,
                       distancesIn(area, *part, object.diameter), cancellation);
  const Image8 allowed = allowedPixels(observation, *part);
  PoseCandidates candidates;
  for (const PoseCandidate& candidate : findings.candidates) {
    if (isAllowed(allowed, *part, candidate.T_O_C.inverse() * object.centre)) {
      candidates.push_back(candidate);
    }
  }
  return candidates;
}

/// The best candidates, as well as small views of the object explain the image.
PoseCandidates ObjectDetector::ranked(const Observation& observation,
                                      const PoseCandidates& candidates, int most,
                                      const CancellationToken& cancellation) {
  if (!ranking_) ranking_.emplace(backend_, field_, settings_.keyframes);
  PoseCandidates best;
  for (const AlignedCandidate& one :
       ranking_->rank(observation, candidates, static_cast<std::size_t>(most), cancellation)) {
    best.push_back(one.candidate);
  }
  return best;
}

/// Aligns what may be the same instance as the best candidate, and takes it from the list.
Refinement ObjectDetector::takeBest(const Observation& observation, ImageCandidates* candidates,
                                    const CancellationToken& cancellation) {
  const FieldMetadata& object = field_->field().metadata;
  PoseCandidates& poses = candidates->poses;
  const Pose best = poses.front().T_O_C;
  const auto same =
      std::stable_partition(poses.begin(), poses.end(), [&](const PoseCandidate& candidate) {
        return !isSameInstance(candidate.T_O_C, best, object);
      });
  std::vector<RoughPose> rough;
  for (auto one = same; one != poses.end(); ++one) {
    if (static_cast<int>(rough.size()) < settings_.max_at_once) rough.push_back({one->T_O_C, 1});
  }
  poses.erase(same, poses.end());
  Refinement found = refiner_.settle({observation, 0}, rough, cancellation);
  cancellation.check();
  // Landmarks speak for the pose that the image leads to, whatever it was found by.
  if (found.outcome == Outcome::kRefined && candidates->matched) {
    const int landmarks =
        landmarksAt(found.T_O_C, *candidates->matched, object, settings_.candidates);
    const double odds = oddsOfLandmarks(landmarks - settings_.candidates.least_landmarks);
    const double by_image = *found.found_probability;
    found.found_probability = withOdds(by_image, odds);
    found.score *= by_image > 0 ? *found.found_probability / by_image : 0;
  }
  return found;
}

void ObjectDetector::settleAll(const Observation& observation,
                               std::chrono::steady_clock::time_point begin,
                               ImageCandidates* candidates, std::vector<Refinement>* found,
                               const CancellationToken& cancellation) {
  const FieldMetadata& object = field_->field().metadata;
  int refused = 0;
  while (!candidates->poses.empty() && static_cast<int>(found->size()) < settings_.max_instances) {
    if (refused >= (found->empty() ? settings_.max_tried : settings_.max_tried_beside)) break;
    if (settings_.budget_s > 0 && secondsSince(begin) > settings_.budget_s) break;
    const Refinement one = takeBest(observation, candidates, cancellation);
    const bool is_known = std::any_of(found->begin(), found->end(), [&](const Refinement& other) {
      return isSameInstance(one.T_O_C, other.T_O_C, object);
    });
    if (is_known) continue;
    if (one.outcome == Outcome::kRefined && one.score >= settings_.least_score) {
      found->push_back(one);
      refused = 0;
    } else {
      ++refused;
    }
  }
}

/// Adds what is found in an area.
void ObjectDetector::detectIn(const SearchArea& area, const Observation& observation,
                              std::chrono::steady_clock::time_point begin, Detections* detections,
                              const CancellationToken& cancellation) {
  area.validate();
  ImageCandidates all = candidates(observation, area, cancellation);
  if (templates_) {
    for (const PoseCandidate& one : templateCandidates(observation, area, cancellation)) {
      all.poses.push_back(one);
    }
    all.poses = ranked(observation, all.poses, settings_.max_ranked, cancellation);
    if (!all.poses.empty()) all.message.clear();
  }
  if (detections->message.empty()) detections->message = all.message;
  detections->candidates.insert(detections->candidates.end(), all.poses.begin(), all.poses.end());
  settleAll(observation, begin, &all, &detections->found, cancellation);
}

Detections ObjectDetector::detect(const Observation& observation, const SearchArea& area,
                                  const CancellationToken& cancellation) {
  const auto begin = std::chrono::steady_clock::now();
  observation.validate();
  Detections detections;
  if (observation.isDepthAlone()) {
    detections.message = "detection compares colours: depth alone needs an initial pose";
    return detections;
  }
  for (const SearchArea& part : areasOf(observation, area)) {
    detectIn(part, observation, begin, &detections, cancellation);
    const bool time_is_up = settings_.budget_s > 0 && secondsSince(begin) > settings_.budget_s;
    const bool is_enough = static_cast<int>(detections.found.size()) >= settings_.max_instances;
    if (time_is_up || is_enough) break;
  }
  std::vector<Refinement>& found = detections.found;
  std::stable_sort(found.begin(), found.end(),
                   [](const Refinement& a, const Refinement& b) { return a.score > b.score; });
  if (!found.empty()) {
    detections.message.clear();
  } else if (detections.message.empty() || !detections.candidates.empty()) {
    detections.message = "no candidate explains the image well enough";
  }
  detections.seconds = secondsSince(begin);
  return detections;
}

bool isSameInstance(const Pose& a_T_O_C, const Pose& b_T_O_C, const FieldMetadata& object) {
  constexpr double kAcross = 0.35, kAlong = 0.2;  // [diameters], [distances]
  const Eigen::Vector3d a = a_T_O_C.inverse() * object.centre;
  const Eigen::Vector3d b = b_T_O_C.inverse() * object.centre;
  const Eigen::Vector3d scaled = b * (a.norm() / b.norm());
  return (scaled - a).norm() < kAcross * object.diameter &&
         std::abs(std::log(a.norm() / b.norm())) < kAlong;
}

}  // namespace nerf_pose_refiner
