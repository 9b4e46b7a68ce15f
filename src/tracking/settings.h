// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "nerf_pose_refiner/pose.h"
#include "refinement/settings.h"

namespace nerf_pose_refiner {

/// When an initial pose is used.
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

/// How a refinement searches, and how far from its start pose.
struct SearchSettings {
  std::string preset;       ///< name of the preset of `refiner`, see RefinerSettings::named
  double rotation_deg = 0;  ///< half width of the search per axis, about the centre, > 0, <= 180
  double translation = 0;   ///< half width of the search per axis [object diameters], > 0, <= 100
  RefinerSettings refiner;

  static SearchSettings named(const std::string& preset, double rotation_deg, double translation) {
    return {preset, rotation_deg, translation, RefinerSettings::named(preset)};
  }

  /// @throws std::invalid_argument naming the setting and the value that is out of range.
  void validate() const;
};

/// When a track begins, continues and ends.
struct TrackingRules {
  TrackStart start = TrackStart::kInitialPose;
  double detect_rate_hz = 30;  ///< > 0: images per second, by stamps, that detection looks at
  /// Fraction of the time that detection takes, > 0, at most 1; infinite: the rate alone counts.
  double detect_share = 0.7;
  double trust_score = 0.9;  ///< 0..1: score at which a track begins
  double min_score = 0.5;    ///< 0..trust_score: while tracking, a lower score is not trusted
  int max_failures = 2;      ///< number of untrusted images in a row that are bridged, >= 0
  bool predict = true;       ///< follow the motion, see MotionFilter
  double recover_s = 5;      ///< a lost object is searched for during this time [s]; 0: never
  bool once = false;         ///< after one trusted pose, wait for the next initial pose
  /// Images may come from another camera than before: transforms carry poses from one to another.
  bool cameras_change = false;
  InitialPosePolicy initial_pose_policy = InitialPosePolicy::kWhenNotTracking;
  double initial_pose_max_age_s =
      10;                      ///< of an initial pose, when it is used [s], > 0; infinite: any
  double image_timeout_s = 2;  ///< without an image for this time, the object is lost [s]; 0: never

  /// @throws std::invalid_argument naming the setting and the value that is out of range.
  void validate() const;
};

/// Which refinements use a mask of the object.
enum class MaskMode {
  kNone,
  kInitial,     ///< only those that start from an initial pose
  kEveryFrame,  ///< all
};

/// Past images that act as further cameras.
struct ViewWindowSettings {
  int views = 0;                  ///< at most, >= 0; 0: none
  double apart_deg = 8;           ///< lines of sight of two views are so far apart at least, > 0
  double position_dev_m = 0.001;  ///< standard deviation of a place of the camera [m], >= 0
  double rotation_dev_deg = 0.1;  ///< alike [degrees], >= 0
  double time_dev_s = 0.005;      ///< of the stamps of places against those of images [s], >= 0
  double renewal_s = 10;          ///< a newer image replaces one that is older, from about there
};

/// How an object is tracked; the defaults are the node's.
struct TrackerSettings {
  /// From an initial pose.
  SearchSettings initial =
      SearchSettings::named("keyframes", kSearchRotation_deg, kSearchTranslation);
  SearchSettings tracking = SearchSettings::named("keyframes", 5, 0.05);  ///< from the last one
  TrackingRules rules;
  MaskMode mask_mode = MaskMode::kNone;
  ViewWindowSettings window;

  /// @throws std::invalid_argument naming the setting and the value that is out of range.
  void validate() const;

  const SearchSettings& search(bool tracked) const { return tracked ? tracking : initial; }
  /// Whether a refinement uses the object's mask. @param tracked it starts from the last pose.
  bool usesMask(bool tracked) const {
    return mask_mode == MaskMode::kEveryFrame || (mask_mode == MaskMode::kInitial && !tracked);
  }
};

}  // namespace nerf_pose_refiner
