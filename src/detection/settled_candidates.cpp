// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <utility>

#include "detection/detector_search.h"
#include "detection/object_detector.h"
#include "refinement/pose_probability.h"

// The part of ObjectDetector that aligns candidates and says which of them are instances.

namespace nerf_pose_refiner {

/// The best candidates of instances that are not found yet, as well as small views of the object
/// explain the image.
PoseCandidates ObjectDetector::ranked(PoseCandidates candidates, int most, Search* search) {
  const TimeSpent time(&search->detections.times.ranking);
  if (!ranking_) ranking_.emplace(backend_, field_, settings_.keyframes);
  search->eraseFound(&candidates);
  RankingLimits limits = {search->window, static_cast<std::size_t>(most),
                          static_cast<std::size_t>(settings_.max_at_once)};
  // Single matches lead everywhere, and so to all views: too many to be rendered for one image.
  limits.may_render = search->cues != DetectionCues::kLandmarks;
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

/// In glances with smaller keyframes, which a CPU renders in a fraction of the time: what is found
/// so is followed with larger ones. Plain objects need all detail that there is.
KeyframeRefiner& ObjectDetector::refinerFor(const Search& search) {
  if (!search.isGlance() || isPlain()) return refiner_;
  if (glancing_) return *glancing_;
  KeyframeSearchSettings settings = settings_.keyframes;
  KeyframeSettings& keyframe = settings.keyframe;
  keyframe.max_side_px = std::min(keyframe.max_side_px, settings_.glance_side_px);
  keyframe.max_rays_of_side = std::min(keyframe.max_rays_of_side, settings_.glance_side_px);
  glancing_.emplace(backend_, field_, settings);
  if (scores_) glancing_->use(*scores_);
  if (look_alikes_) glancing_->use(*look_alikes_);
  return *glancing_;
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
  const double least = search.isGlance() ? kHopelessProbability : 0;
  const Refinement found =
      refinerFor(search).settle({search.observation, 0}, rough, odds, search.cancellation, least);
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

bool isOutdone(const Refinement& pose, const std::vector<Refinement>& doubted,
               const SameInstance& is_same_instance) {
  return std::any_of(doubted.begin(), doubted.end(), [&](const Refinement& other) {
    return is_same_instance(pose.T_O_C, other.T_O_C) &&
           other.found_probability.value_or(0) >= pose.found_probability.value_or(0);
  });
}

}  // namespace nerf_pose_refiner
