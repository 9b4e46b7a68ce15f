// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "detection/candidate.h"
#include "detection/image_features.h"
#include "detection/landmark_matcher.h"
#include "detection/landmarks.h"
#include "detection/pose_votes.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/cancellation_token.h"

namespace nerf_pose_refiner {

struct FieldMetadata;

struct LandmarkCandidateSettings {
  VoteTolerance votes;
  double max_ratio = 0.9;           ///< of matches that vote, @see FeatureMatch
  int least_landmarks = 4;          ///< that agree with a candidate
  int most_candidates = 24;         ///< that are returned
  int most_groups = 150;            ///< of votes that are looked at
  int most_single = 300;            ///< poses of single matches that are returned
  double threshold = 0.02;          ///< of a landmark from its feature [diameters in the image]
  double least_threshold_px = 1.5;  ///< the same, at least
};

/// Features of an image and the landmarks that they match.
struct MatchedImage {
  Camera camera;
  std::vector<FeaturePlace> features;
  const Landmarks& landmarks;
  std::vector<FeatureMatch> matches;
};

/// How many landmarks are seen where a pose puts them, of the size and orientation that they have
/// there, each at a place of its own. Matches that look like several places count, too, and those
/// that are not their feature's best: that one of six of thousands agrees with the pose is rarely
/// chance.
int landmarksAt(const Pose& T_O_C, const MatchedImage& image, const FieldMetadata& object,
                const LandmarkCandidateSettings& settings);

/// How much likelier a pose is for the landmarks that agree with it. Of 105 wrong poses in images
/// of other objects one agreed with 14, two with 20, three or four with 12, more with none; and
/// neighbours are often alike. Plain objects have few, of which each is more often one of six.
double oddsOfLandmarks(int landmarks, bool is_plain);

/// Poses that many matches agree with. Each match votes for a pose by the place, the size and the
/// orientation of its feature; the pose of a group of votes is that of its points. A match belongs
/// to one candidate alone, so that several instances are apart from each other; but of points in a
/// plane both poses are there.
PoseCandidates landmarkCandidates(const MatchedImage& image, const FieldMetadata& object,
                                  const LandmarkCandidateSettings& settings,
                                  const CancellationToken& cancellation);

/// The poses that single matches vote for, those first that most others agree with: rough, and
/// nearly all wrong, but where little of the object is seen one of them may be the only right one.
/// Their evidence is the number of votes that agree.
PoseCandidates singleMatchCandidates(const MatchedImage& image, const FieldMetadata& object,
                                     const LandmarkCandidateSettings& settings);

}  // namespace nerf_pose_refiner
