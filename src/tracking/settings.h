// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "refinement/settings.h"

namespace nerf_pose_refiner {

/// When an initial pose is taken.
enum class InitialPosePolicy {
  kWhenNotTracking,  ///< ignored while the object is tracked
  kAlways,
};

/// What a track begins with.
enum class TrackStart {
  kInitialPose,  ///< a pose from outside
  kDetect,       ///< detection in the whole image; poses from outside are ignored
  kBoth,         ///< a pose from outside if there is one, else detection
};

/// How a refinement searches, and how far around its start.
struct SearchSettings {
  std::string preset;       ///< that `refiner` began with, see RefinerSettings::named
  double rotation_deg = 0;  ///< half width of the search per axis, about the object's centre, > 0
  double translation = 0;   ///< half width of the search per axis [object diameters], > 0
  RefinerSettings refiner;

  static SearchSettings named(const std::string& preset, double rotation_deg, double translation) {
    return {preset, rotation_deg, translation, RefinerSettings::named(preset)};
  }
};

/// What begins a track, what keeps it, and what ends it.
struct TrackingRules {
  TrackStart start = TrackStart::kInitialPose;
  double detect_rate_hz = 1;  ///< images a second, by their stamps, that detection looks at, > 0
  double trust_score = 0.18;  ///< 0..1: a track begins with a pose that explains the image so well
  double min_score = 0.1;     ///< 0..trust_score: it does not go on with one that does so worse
  int max_failures = 2;       ///< so many untrusted images in a row are bridged, >= 0
  bool predict = true;        ///< look where the last two poses point to, not around the last
  double recover_s = 5;  ///< so long after the last trusted pose it is tried again [s]; 0: never
  bool once = false;     ///< back to waiting after one trusted pose
  InitialPosePolicy initial_pose_policy = InitialPosePolicy::kWhenNotTracking;
  double initial_pose_max_age_s = 10;  ///< of an initial pose when it is used [s], > 0
  double image_timeout_s = 2;          ///< without an image for so long: lost [s]; 0: never
};

/// Which refinements make use of a mask of the object.
enum class MaskMode {
  kNone,
  kInitial,     ///< those from an initial pose
  kEveryFrame,  ///< all
};

/// How an object is tracked; the defaults are the node's.
struct TrackerSettings {
  SearchSettings initial = SearchSettings::named("keyframes", 15, 0.15);  ///< from an initial pose
  SearchSettings tracking = SearchSettings::named("keyframes", 5, 0.05);  ///< from the last pose
  TrackingRules rules;
  MaskMode mask_mode = MaskMode::kNone;

  const SearchSettings& search(bool tracked) const { return tracked ? tracking : initial; }
  /// Whether a refinement makes use of the object's mask. @param tracked it starts from the last
  /// pose.
  bool usesMask(bool tracked) const {
    return mask_mode == MaskMode::kEveryFrame || (mask_mode == MaskMode::kInitial && !tracked);
  }
};

}  // namespace nerf_pose_refiner
