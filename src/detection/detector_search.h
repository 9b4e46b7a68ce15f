// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <vector>

#include "detection/object_detector.h"

namespace nerf_pose_refiner {

/// One search of an image.
struct ObjectDetector::Search {
  const Observation& observation;
  CancellationToken cancellation;  // also when the time is up
  const SameInstance& is_same_instance;
  DetectionCues cues;
  PixelWindow window = {};               // of the image, that is searched now
  double odds = 1;                       // of poses in it
  bool is_first_look = false;            // the features are those of a reduced image
  std::vector<Refinement> doubted = {};  // poses that were found but not trusted
  Detections detections = {};

  bool isGlance() const { return cues != DetectionCues::kAll; }
  /// How many of so many candidates are tried.
  int share(int all) const { return isGlance() || is_first_look ? std::max(1, all / 2) : all; }
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

}  // namespace nerf_pose_refiner
