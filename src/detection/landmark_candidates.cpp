// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/landmark_candidates.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <set>
#include <utility>

#include "detection/point_pose.h"
#include "field/field.h"

namespace nerf_pose_refiner {
namespace {

/// Of a landmark from its feature where the object is as large as that [px].
double thresholdFor(double diameter_px, const LandmarkCandidateSettings& settings) {
  return std::max(settings.least_threshold_px, settings.threshold * diameter_px);
}

/// Counts matches, each at a place of its own and of a landmark of its own.
class DistinctMatches {
 public:
  void add(const Eigen::Vector2d& pixel, int landmark) {
    const std::pair<long, long> place(std::lround(pixel.x()), std::lround(pixel.y()));
    if (pixels_.count(place) > 0 || !landmarks_.insert(landmark).second) return;
    pixels_.insert(place);
  }
  int count() const { return static_cast<int>(pixels_.size()); }

 private:
  std::set<std::pair<long, long>> pixels_;
  std::set<int> landmarks_;
};

const FeaturePlace& featureOf(const FeatureMatch& match, const MatchedImage& image) {
  return image.features[static_cast<std::size_t>(match.feature)];
}

const Landmark& landmarkOf(const FeatureMatch& match, const MatchedImage& image) {
  return image.landmarks.places[static_cast<std::size_t>(match.landmark)];
}

/// The pose that a match speaks for by itself, and where its landmark is for that pose.
struct MatchedPose {
  Pose T_O_C;
  Eigen::Vector3d point_O;
};

/// @param reference_T_O_C of the poses that look alike by the object's symmetries, the nearest to
/// it. Turns about an axis are left as they are: for those, one match is too rough.
MatchedPose poseOf(const FeatureMatch& match, const MatchedImage& image,
                   const Pose& reference_T_O_C, const Symmetries& symmetries) {
  const Landmark& landmark = landmarkOf(match, image);
  const Eigen::Vector3d point_O = landmark.point.cast<double>();
  const Pose T_O_C = poseFromMatch(image.camera, featureOf(match, image), landmark);
  const auto nearness = [&](const Pose& motion) {
    return (motion.R * T_O_C.R).cwiseProduct(reference_T_O_C.R).sum();
  };
  const std::vector<Pose>& motions = symmetries.motions();
  const Pose nearest =
      *std::max_element(motions.begin(), motions.end(),
                        [&](const Pose& a, const Pose& b) { return nearness(a) < nearness(b); });
  return {nearest * T_O_C, nearest * point_O};
}

/// Makes the candidates of one image.
class CandidateSearch {
 public:
  CandidateSearch(const MatchedImage& image, const FieldMetadata& object,
                  const LandmarkCandidateSettings& settings)
      : image_(image), object_(object), settings_(settings) {
    for (const FeatureMatch& match : image.matches) {
      if (match.rank > 0 || match.ratio > settings.max_ratio) continue;
      // Of symmetric poses one stands for all, so that matches of one instance agree.
      const MatchedPose one = poseOf(match, image, Pose(), object.symmetries);
      const auto vote = voteFor(one.T_O_C, image.camera, object);
      if (!vote) continue;
      const FeaturePlace& feature = featureOf(match, image);
      votes_.push_back(*vote);
      poses_.push_back(one.T_O_C);
      points_.push_back({one.point_O, {feature.x, feature.y}});
      landmarks_.push_back(match.landmark);
    }
  }

  PoseCandidates run(const CancellationToken& cancellation) {
    VoteCounter counter(votes_, settings_.votes);
    PoseCandidates candidates;
    for (int tried = 0; tried < settings_.most_groups;) {
      cancellation.check();
      const std::vector<int> group = counter.largestGroup();
      if (static_cast<int>(group.size()) < settings_.least_landmarks) break;
      const int vote = group.front();                        // the one that the group is around
      if (landmarksIn(group) < settings_.least_landmarks) {  // a texture that repeats one of them
        counter.remove(vote);
        continue;
      }
      ++tried;
      const std::vector<int> used = addFrom(group, counter.left(), &candidates);
      for (const int match : used) counter.remove(match);
      counter.remove(vote);
    }
    keepBest(settings_.most_candidates, &candidates);
    return candidates;
  }

  PoseCandidates ofSingleMatches() const {
    const VoteCounter counter(votes_, settings_.votes);
    PoseCandidates candidates;
    for (std::size_t i = 0; i < votes_.size(); ++i) {
      const double agreeing = landmarksIn(counter.agreeing(static_cast<int>(i)));
      candidates.push_back({poses_[i], agreeing, CandidateSource::kLandmarks});
    }
    keepBest(settings_.most_single, &candidates);
    return candidates;
  }

 private:
  static void keepBest(int most, PoseCandidates* candidates) {
    std::stable_sort(
        candidates->begin(), candidates->end(),
        [](const PoseCandidate& a, const PoseCandidate& b) { return a.evidence > b.evidence; });
    if (candidates->size() > static_cast<std::size_t>(most)) {
      candidates->resize(static_cast<std::size_t>(most));
    }
  }

  double thresholdOf(int vote) const {
    return thresholdFor(votes_[static_cast<std::size_t>(vote)].diameter_px, settings_);
  }

  std::vector<PointMatch> pointsOf(const std::vector<int>& matches) const {
    std::vector<PointMatch> points;
    for (const int match : matches) points.push_back(points_[static_cast<std::size_t>(match)]);
    return points;
  }

  /// The candidates of a group's points, refined with all matches that are left and agree.
  /// @return the matches that agree with the first one; none: it is no candidate.
  std::vector<int> addFrom(const std::vector<int>& group, const std::vector<int>& left,
                           PoseCandidates* candidates) const {
    const double threshold = thresholdOf(group.front());
    const std::optional<PointPose> rough = poseOfMost(pointsOf(group), image_.camera, threshold);
    if (!rough) return {};
    const std::vector<PointMatch> points = pointsOf(left);
    const std::optional<PointPose> pose =
        refinedPose(rough->T_C_O, points, image_.camera, threshold);
    if (!pose || !add(*pose, left, candidates)) return {};
    if (const std::optional<Pose> mirrored = otherPoseOfPlane(*pose, points)) {
      const std::optional<PointPose> other =
          refinedPose(*mirrored, points, image_.camera, threshold);
      if (other && rotationDistance(other->T_C_O.R, pose->T_C_O.R) > kOtherRotation) {
        add(*other, left, candidates);
      }
    }
    return matchesOf(*pose, left);
  }

  int landmarksIn(const std::vector<int>& group) const {
    DistinctMatches matches;
    for (const int member : group) {
      const auto match = static_cast<std::size_t>(member);
      matches.add(points_[match].pixel, landmarks_[match]);
    }
    return matches.count();
  }

  /// @param left what inliers are numbers of.
  static std::vector<int> matchesOf(const PointPose& pose, const std::vector<int>& left) {
    std::vector<int> matches;
    for (const int inlier : pose.inliers) matches.push_back(left[static_cast<std::size_t>(inlier)]);
    return matches;
  }

  bool add(const PointPose& pose, const std::vector<int>& left, PoseCandidates* candidates) const {
    const Pose T_O_C = pose.T_C_O.inverse();
    const int landmarks = landmarksIn(matchesOf(pose, left));
    if (landmarks < settings_.least_landmarks) return false;
    if (!voteFor(T_O_C, image_.camera, object_)) return false;
    candidates->push_back({T_O_C, static_cast<double>(landmarks), CandidateSource::kLandmarks});
    return true;
  }

  static constexpr double kOtherRotation = 0.1;  // less: the same solution [rad]

  const MatchedImage& image_;
  const FieldMetadata& object_;
  const LandmarkCandidateSettings& settings_;
  // Of the matches whose vote makes sense.
  std::vector<PoseVote> votes_;
  std::vector<Pose> poses_;
  std::vector<PointMatch> points_;
  std::vector<int> landmarks_;
};

}  // namespace

int landmarksAt(const Pose& T_O_C, const MatchedImage& image, const FieldMetadata& object,
                const LandmarkCandidateSettings& settings) {
  const auto seen = voteFor(T_O_C, image.camera, object);
  if (!seen) return 0;
  const double threshold = thresholdFor(seen->diameter_px, settings);
  const Pose T_C_O = T_O_C.inverse();
  const auto isAt = [&](const Eigen::Vector3d& point_C, const Eigen::Vector2d& pixel) {
    return point_C.z() > 0 && (image.camera.project(point_C) - pixel).norm() <= threshold;
  };
  const std::vector<Pose>& motions = object.symmetries.motions();
  DistinctMatches matches;
  for (const FeatureMatch& match : image.matches) {
    const Eigen::Vector2d pixel(featureOf(match, image).x, featureOf(match, image).y);
    const Eigen::Vector3d point_O = landmarkOf(match, image).point.cast<double>();
    // Most are elsewhere, which is found out faster than the pose that a match speaks for.
    if (std::none_of(motions.begin(), motions.end(),
                     [&](const Pose& motion) { return isAt(T_C_O * (motion * point_O), pixel); })) {
      continue;
    }
    const MatchedPose one = poseOf(match, image, T_O_C, object.symmetries);
    if (!isAt(T_C_O * one.point_O, pixel)) continue;
    const auto vote = voteFor(one.T_O_C, image.camera, object);
    if (vote && agree(*vote, *seen, settings.votes)) matches.add(pixel, match.landmark);
  }
  return matches.count();
}

double oddsOfLandmarks(int landmarks, bool is_plain) {
  const int by_chance = is_plain ? 4 : 2;
  const double of_each = is_plain ? 2 : 3;
  const double most = is_plain ? 20 : 100;  // the image has to agree, too: parts look alike
  return std::min(most, std::pow(of_each, std::max(0, landmarks - by_chance)));
}

PoseCandidates landmarkCandidates(const MatchedImage& image, const FieldMetadata& object,
                                  const LandmarkCandidateSettings& settings,
                                  const CancellationToken& cancellation) {
  return CandidateSearch(image, object, settings).run(cancellation);
}

PoseCandidates singleMatchCandidates(const MatchedImage& image, const FieldMetadata& object,
                                     const LandmarkCandidateSettings& settings) {
  return CandidateSearch(image, object, settings).ofSingleMatches();
}

}  // namespace nerf_pose_refiner
