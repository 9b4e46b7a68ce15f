// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/object_detector.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "concurrency/seconds_since.h"
#include "detection/detector_search.h"
#include "detection/shared_features.h"
#include "field/field.h"
#include "math/require.h"
#include "refinement/pose_probability.h"

namespace nerf_pose_refiner {
namespace {

/// Distances at which the object may be [diameters].
DistanceRange distancesIn(const SearchArea& area, const Camera& part, double diameter) {
  constexpr double kNearest = 0.8;
  DistanceRange range = DistanceRange::usual(part);
  if (area.distance) {
    const double distance = *area.distance / diameter;
    range = {std::max(kNearest, distance / area.distance_ratio),
             std::max(kNearest, distance * area.distance_ratio)};
  }
  return range;
}

/// @param budget_s 0: no limit.
CancellationToken withBudget(const CancellationToken& cancellation,
                             std::chrono::steady_clock::time_point begin, double budget_s) {
  using Clock = std::chrono::steady_clock;
  if (!(budget_s > 0)) return cancellation;
  return cancellation.childUntil(
      begin + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(budget_s)));
}

}  // namespace

void DetectionSettings::validate() const {
  model.validate();
  matching.validate();
  require(features.max_features >= 1, "DetectionSettings::features.max_features",
          features.max_features);
  require(candidates.least_landmarks >= 4, "DetectionSettings::candidates.least_landmarks",
          candidates.least_landmarks);
  require(max_image_side_px >= 32, "DetectionSettings::max_image_side_px", max_image_side_px);
  require(first_look_side_px == 0 || first_look_side_px >= 32,
          "DetectionSettings::first_look_side_px", first_look_side_px);
  require(glance_side_px >= 32, "DetectionSettings::glance_side_px", glance_side_px);
  require(max_instances >= 1, "DetectionSettings::max_instances", max_instances);
  require(max_tried >= 1, "DetectionSettings::max_tried", max_tried);
  require(max_ranked >= 1, "DetectionSettings::max_ranked", max_ranked);
  require(max_ranked_single >= 1, "DetectionSettings::max_ranked_single", max_ranked_single);
  require(max_tried_beside >= 1, "DetectionSettings::max_tried_beside", max_tried_beside);
  require(max_at_once >= 1, "DetectionSettings::max_at_once", max_at_once);
  require(least_score >= 0 && least_score <= 1, "DetectionSettings::least_score", least_score);
  require(budget_s >= 0, "DetectionSettings::budget_s", budget_s);
}

ObjectDetector::ObjectDetector(Backend* backend, std::shared_ptr<const LoadedField> field,
                               DetectionModel model, const DetectionSettings& settings)
    : backend_(backend),
      field_(std::move(field)),
      settings_(settings),
      is_plain_(model.is_plain),
      landmarks_(std::make_unique<const Landmarks>(std::move(model.landmarks))),
      matcher_(backend, *landmarks_, field_->field().metadata, settings_.matching),
      refiner_(backend, field_, settings.keyframes),
      is_same_instance_(field_->field()) {
  settings_.validate();
  if (model.templates) {
    templates_.emplace(backend_, std::move(model.templates), field_->field().metadata,
                       settings_.templates);
  }
}

void ObjectDetector::use(const KeyframeScores& scores) {
  scores_ = scores;
  refiner_.use(scores);
  if (glancing_) glancing_->use(scores);
}

void ObjectDetector::use(const LookAlikes& look_alikes) {
  look_alikes_ = look_alikes;
  refiner_.use(look_alikes);
  if (glancing_) glancing_->use(look_alikes);
}

ImageCandidates ObjectDetector::candidates(const Observation& observation, const SearchArea& area,
                                           const CancellationToken& cancellation) const {
  return candidatesAt(settings_.max_image_side_px, observation, area, cancellation);
}

ImageCandidates ObjectDetector::candidatesAt(int max_side_px, const Observation& observation,
                                             const SearchArea& area,
                                             const CancellationToken& cancellation) const {
  ImageCandidates result;
  const std::optional<SearchedPart> part = searchedPart(observation.camera, area, max_side_px);
  if (!part) {
    result.message = area.box ? "the box leaves too little of the image" : "the image is too small";
    return result;
  }
  FeatureSettings settings = settings_.features;
  settings.kind = landmarks_->kind;
  const auto features = timed(&result.times.features, [&] {
    return SharedFeatures::ofProcess().of(luminance(coloursOf(observation, *part)),
                                          allowedPixels(observation, part->camera), settings,
                                          cancellation);
  });
  cancellation.check();
  timed(&result.times.landmarks, [&] {
    result.matched.emplace(
        MatchedImage{part->camera, features->places, *landmarks_, matcher_.match(*features)});
    result.poses = atDistance(area, landmarkCandidates(*result.matched, field_->field().metadata,
                                                       settings_.candidates, cancellation));
  });
  if (features->size() == 0) {
    result.message = "the image has no features";
  } else if (result.poses.empty()) {
    result.message = "no pose agrees with enough landmarks";
  }
  return result;
}

double ObjectDetector::oddsAt(const Pose& T_O_C, const MatchedImage& matched) const {
  return oddsOfLandmarks(
      landmarksAt(T_O_C, matched, field_->field().metadata, settings_.candidates), isPlain());
}

void ObjectDetector::weigh(const MatchedImage& matched, Refinement* pose) const {
  if (pose->outcome == Outcome::kRefined) changeOdds(oddsAt(pose->T_O_C, matched), pose);
}

/// Those of the distances that an area leaves.
PoseCandidates ObjectDetector::atDistance(const SearchArea& area, PoseCandidates candidates) const {
  const FieldMetadata& object = field_->field().metadata;
  const auto isBeyond = [&](const PoseCandidate& one) {
    return !isAtDistance(area, (one.T_O_C.t - object.centre).norm());
  };
  candidates.erase(std::remove_if(candidates.begin(), candidates.end(), isBeyond),
                   candidates.end());
  return candidates;
}

PoseCandidates ObjectDetector::templateCandidates(const Observation& observation,
                                                  const SearchArea& area,
                                                  const CancellationToken& cancellation,
                                                  bool by_depth) {
  const std::optional<SearchedPart> part =
      searchedPart(observation.camera, area, settings_.max_image_side_px);
  if (!part || !templates_) return {};
  const Camera& camera = part->camera;
  const FieldMetadata& object = field_->field().metadata;
  std::optional<DepthLayers> layers;
  if (by_depth) {
    if (observation.depth) layers = DepthLayers::of(*observation.depth, camera, object);
    if (!layers) return {};
  }
  const TemplateFindings findings = templates_->find(coloursOf(observation, *part), camera,
                                                     distancesIn(area, camera, object.diameter),
                                                     cancellation, layers ? &*layers : nullptr);
  const Image8 allowed = allowedPixels(observation, camera);
  PoseCandidates candidates;
  for (const PoseCandidate& candidate : findings.candidates) {
    const auto place = voteFor(candidate.T_O_C, camera, object);
    if (place && isAnyAllowed(allowed, {place->x, place->y}, place->diameter_px / 2)) {
      candidates.push_back(candidate);
    }
  }
  return candidates;
}

/// The side of the reduced image whose features are looked at first; nothing: that saves little, a
/// plain object would rarely have enough of them, or several instances are looked for, of which
/// some might be overlooked.
std::optional<int> ObjectDetector::firstLookSide_px(const PixelWindow& window) const {
  constexpr double kMost = 0.75;  // of the side that features are found in else: saves half of them
  const int side_px = settings_.first_look_side_px;
  const int all_px = std::min(std::max(window.width, window.height), settings_.max_image_side_px);
  const bool is_worth_it = side_px > 0 && side_px <= kMost * all_px;
  return is_worth_it && !isPlain() && settings_.max_instances == 1 ? std::optional<int>(side_px)
                                                                   : std::nullopt;
}

/// Adds an instance that the features of a reduced image lead to. @return whether there is one.
bool ObjectDetector::findAtFirstLook(int side_px, const SearchArea& area, Search* search) {
  const std::size_t doubted = search->doubted.size();
  const std::string message = search->detections.message;
  search->is_first_look = true;
  ImageCandidates all = candidatesAt(side_px, search->observation, area, search->cancellation);
  search->detections.times += all.times;
  if (search->detections.message.empty()) search->detections.message = all.message;
  settleFrom(std::move(all.poses), &all, search);
  search->is_first_look = false;
  if (search->isEnough(settings_.max_instances)) return true;
  if (search->cues == DetectionCues::kAll) {  // all of the image has the last word
    search->doubted.resize(doubted);
    search->detections.message = message;
  }
  return false;
}

/// Adds what landmarks lead to: first those of a reduced image, where that saves time, then what
/// several agree on, then, if that is nothing, what one does. @return with what of the image looks
/// like landmarks.
ImageCandidates ObjectDetector::findByLandmarks(const SearchArea& area, Search* search) {
  Detections& detections = search->detections;
  const bool alone = search->cues == DetectionCues::kFirstLook;
  const bool looks = alone || search->cues == DetectionCues::kAll;
  if (const auto side_px = looks ? firstLookSide_px(search->window) : std::nullopt) {
    if (findAtFirstLook(*side_px, area, search) || alone) return {};
  }
  const std::size_t before = detections.found.size();
  ImageCandidates all = candidates(search->observation, area, search->cancellation);
  detections.times += all.times;
  if (detections.message.empty()) detections.message = all.message;
  settleFrom(std::move(all.poses), &all, search);
  const bool also_single =
      search->cues == DetectionCues::kAll || search->cues == DetectionCues::kLandmarks;
  const bool goes_on = also_single && detections.found.size() == before &&
                       !search->isEnough(settings_.max_instances);
  if (all.matched && goes_on) {
    settleFrom(singleMatches(*all.matched, area, search), &all, search);
  }
  return all;
}

/// Adds what is found in an area: first what is found fastest.
void ObjectDetector::detectIn(const SearchArea& area, Search* search) {
  area.validate();
  const auto part = searchedPart(search->observation.camera, area, settings_.max_image_side_px);
  if (part) search->window = part->window;
  search->odds = oddsIn(area, search->observation);
  const std::size_t before = search->detections.found.size();
  const bool by_landmarks = search->cues != DetectionCues::kTemplates;
  ImageCandidates all = by_landmarks ? findByLandmarks(area, search) : ImageCandidates();
  // (A textured object has templates for images in which its landmarks are not seen.)
  const bool wants_more = isPlain() || search->detections.found.size() == before;
  const bool by_templates =
      templates_ && (!by_landmarks || (search->cues == DetectionCues::kAll && wants_more));
  if (by_templates && !search->isEnough(settings_.max_instances)) {
    findByTemplates(area, &all, search);
  }
}

/// Adds what templates lead to: with depth first where that shows something at the right distance.
/// Depth may be wrong: if nothing is found there, all of the image is looked at; in a glance, only
/// if there are no candidates.
void ObjectDetector::findByTemplates(const SearchArea& area, ImageCandidates* all, Search* search) {
  const std::size_t before = search->detections.found.size();
  for (const bool by_depth : {true, false}) {
    if (by_depth && !search->observation.depth) continue;
    const PoseCandidates rough = timed(&search->detections.times.templates, [&] {
      return templateCandidates(search->observation, area, search->cancellation, by_depth);
    });
    settleFrom(ranked(rough, settings_.max_ranked, search), all, search);
    if (search->detections.found.size() > before) return;
    if (by_depth && search->isGlance() && !rough.empty()) return;
  }
}

Detections ObjectDetector::detect(const Observation& observation, const SearchArea& area,
                                  const CancellationToken& cancellation, DetectionCues cues) {
  const auto begin = std::chrono::steady_clock::now();
  Search search = {observation, withBudget(cancellation, begin, settings_.budget_s),
                   is_same_instance_, cues};
  observation.validate();
  Detections& detections = search.detections;
  if (observation.isDepthAlone()) {
    detections.message = "detection compares colours: depth alone needs an initial pose";
    return detections;
  }
  bool is_time_up = false;
  try {
    for (const SearchArea& part : areasOf(observation, area)) {
      detectIn(part, &search);
      if (search.isEnough(settings_.max_instances)) break;
    }
  } catch (const Cancelled&) {
    cancellation.check();
    is_time_up = true;  // what was found until then counts
  }
  std::vector<Refinement>& found = detections.found;
  const auto is_outdone = [&](const Refinement& one) {
    return isOutdone(one, search.doubted, is_same_instance_);
  };
  found.erase(std::remove_if(found.begin(), found.end(), is_outdone), found.end());
  std::stable_sort(found.begin(), found.end(),
                   [](const Refinement& a, const Refinement& b) { return a.score > b.score; });
  if (!found.empty()) {
    detections.message.clear();
  } else if (is_time_up) {
    detections.message = "nothing was found within the time that it may take";
  } else if (detections.message.empty() || !detections.candidates.empty()) {
    detections.message = "no candidate explains the image well enough";
  }
  detections.seconds = secondsSince(begin);
  return detections;
}

}  // namespace nerf_pose_refiner
