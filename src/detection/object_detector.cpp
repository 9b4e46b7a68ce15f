// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/object_detector.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>

#include "concurrency/seconds_since.h"
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

/// Whether a pixel is allowed where the object may be. At its centre, it may have a hole.
bool isAllowed(const Image8& allowed, const PoseVote& place) {
  if (allowed.empty()) return true;
  const double radius = place.diameter_px / 2;
  const auto clamped = [](double value, int size) {
    return static_cast<int>(std::clamp<double>(std::lround(value), 0, size));
  };
  const int right = clamped(place.x + radius + 1, allowed.width);
  const int bottom = clamped(place.y + radius + 1, allowed.height);
  for (int y = clamped(place.y - radius, allowed.height); y < bottom; ++y) {
    for (int x = clamped(place.x - radius, allowed.width); x < right; ++x) {
      if (allowed.at(x, y, 0) > 0) return true;
    }
  }
  return false;
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

ImageCandidates ObjectDetector::candidates(const Observation& observation, const SearchArea& area,
                                           const CancellationToken& cancellation) const {
  ImageCandidates result;
  const std::optional<SearchedPart> part =
      searchedPart(observation.camera, area, settings_.max_image_side_px);
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
      landmarksAt(T_O_C, matched, field_->field().metadata, settings_.candidates), usesTemplates());
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
    if (place && isAllowed(allowed, *place)) {
      candidates.push_back(candidate);
    }
  }
  return candidates;
}

/// One search of an image.
struct ObjectDetector::Search {
  const Observation& observation;
  CancellationToken cancellation;  // also when the time is up
  const SameInstance& is_same_instance;
  DetectionCues cues;
  PixelWindow window = {};               // of the image, that is searched now
  double odds = 1;                       // of poses in it
  std::vector<Refinement> doubted = {};  // poses that were found but not trusted
  Detections detections = {};

  bool isGlance() const { return cues != DetectionCues::kAll; }
  /// How many of so many candidates are tried.
  int share(int all) const { return isGlance() ? std::max(1, all / 2) : all; }
  bool isEnough(int most) const { return static_cast<int>(detections.found.size()) >= most; }
  bool isFound(const Pose& T_O_C) const {
    const std::vector<Refinement>& found = detections.found;
    return std::any_of(found.begin(), found.end(),
                       [&](const Refinement& one) { return is_same_instance(T_O_C, one.T_O_C); });
  }
  void eraseFound(PoseCandidates* candidates) const {
    const auto is_found = [this](const PoseCandidate& one) { return isFound(one.T_O_C); };
    candidates->erase(std::remove_if(candidates->begin(), candidates->end(), is_found),
                      candidates->end());
  }
};

/// The best candidates of instances that are not found yet, as well as small views of the object
/// explain the image.
PoseCandidates ObjectDetector::ranked(PoseCandidates candidates, int most, Search* search) {
  const TimeSpent time(&search->detections.times.ranking);
  if (!ranking_) ranking_.emplace(backend_, field_, settings_.keyframes);
  search->eraseFound(&candidates);
  const RankingLimits limits = {search->window, static_cast<std::size_t>(most),
                                static_cast<std::size_t>(settings_.max_at_once)};
  PoseCandidates best;
  for (const AlignedCandidate& one :
       ranking_->rank(search->observation, candidates, limits, search->cancellation)) {
    best.push_back(one.candidate);
  }
  return best;
}

/// The candidates of single matches whose aligned poses further landmarks agree with, best first.
PoseCandidates ObjectDetector::singleMatches(const MatchedImage& matched, const SearchArea& area,
                                             Search* search) {
  constexpr int kLeast = 2;  // landmarks: one proves nothing
  const FieldMetadata& object = field_->field().metadata;
  LandmarkCandidateSettings settings = settings_.candidates;
  settings.most_single = search->share(settings.most_single);
  const PoseCandidates all = atDistance(area, singleMatchCandidates(matched, object, settings));
  PoseCandidates best;
  for (const PoseCandidate& one :
       atDistance(area, ranked(all, settings_.max_ranked_single, search))) {
    if (landmarksAt(one.T_O_C, matched, object, settings_.candidates) >= kLeast) {
      best.push_back(one);
    }
  }
  return best;
}

/// Aligns what may be the same instance as the best candidate, and takes it from the list.
/// Landmarks, where they were looked for, speak for the pose that the image leads to, whatever it
/// was found by.
Refinement ObjectDetector::takeBest(ImageCandidates* candidates, const Search& search) {
  PoseCandidates& poses = candidates->poses;
  const Pose best = poses.front().T_O_C;
  const auto same = std::stable_partition(
      poses.begin(), poses.end(),
      [&](const PoseCandidate& candidate) { return !is_same_instance_(candidate.T_O_C, best); });
  const int most = search.isGlance() ? 1 : settings_.max_at_once;
  std::vector<Pose> rough;
  for (auto one = same; one != poses.end(); ++one) {
    if (static_cast<int>(rough.size()) < most) rough.push_back(one->T_O_C);
  }
  poses.erase(same, poses.end());
  const auto odds = [&](const Pose& T_O_C) {
    return search.odds * (candidates->matched ? oddsAt(T_O_C, *candidates->matched) : 1);
  };
  constexpr double kHopeless = 0.005;
  const double least = search.isGlance() ? kHopeless : 0;
  const Refinement found =
      refiner_.settle({search.observation, 0}, rough, odds, search.cancellation, least);
  if (found.outcome == Outcome::kCancelled) throw Cancelled();
  return found;
}

void ObjectDetector::settleAll(ImageCandidates* candidates, Search* search) {
  const TimeSpent time(&search->detections.times.settling);
  const std::vector<Refinement>& found = search->detections.found;
  const std::size_t before = found.size();
  int refused = 0;
  while (!candidates->poses.empty() && !search->isEnough(settings_.max_instances)) {
    const int most = found.size() > before ? settings_.max_tried_beside : settings_.max_tried;
    if (refused >= search->share(most)) break;
    const Refinement one = takeBest(candidates, *search);
    if (search->isFound(one.T_O_C)) continue;
    if (one.outcome == Outcome::kRefined && one.score >= settings_.least_score &&
        !isOutdone(one, search->doubted, is_same_instance_)) {
      search->detections.found.push_back(one);
      search->eraseFound(&candidates->poses);
      refused = 0;
    } else {
      search->doubted.push_back(one);
      ++refused;
    }
  }
}

void ObjectDetector::settleFrom(PoseCandidates poses, ImageCandidates* all, Search* search) {
  PoseCandidates& noted = search->detections.candidates;
  noted.insert(noted.end(), poses.begin(), poses.end());
  all->poses = std::move(poses);
  settleAll(all, search);
}

/// Adds what landmarks lead to: first what several agree on, then, if that is nothing, what one
/// does. @return with what of the image looks like landmarks.
ImageCandidates ObjectDetector::findByLandmarks(const SearchArea& area, Search* search) {
  Detections& detections = search->detections;
  const std::size_t before = detections.found.size();
  ImageCandidates all = candidates(search->observation, area, search->cancellation);
  detections.times += all.times;
  if (detections.message.empty()) detections.message = all.message;
  settleFrom(std::move(all.poses), &all, search);
  const bool goes_on = search->cues != DetectionCues::kAgreeingLandmarks &&
                       detections.found.size() == before &&
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
  search->odds = area.odds;
  const bool by_landmarks = search->cues != DetectionCues::kTemplates;
  ImageCandidates all = by_landmarks ? findByLandmarks(area, search) : ImageCandidates();
  const bool by_templates = templates_ && (search->cues == DetectionCues::kAll || !by_landmarks);
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

bool isOutdone(const Refinement& pose, const std::vector<Refinement>& doubted,
               const SameInstance& is_same_instance) {
  return std::any_of(doubted.begin(), doubted.end(), [&](const Refinement& other) {
    return is_same_instance(pose.T_O_C, other.T_O_C) &&
           other.found_probability.value_or(0) >= pose.found_probability.value_or(0);
  });
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
