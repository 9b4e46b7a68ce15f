// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "backend/plans.h"
#include "refinement/keyframe_settings.h"

namespace nerf_pose_refiner {

/// How the pose is searched.
enum class Method {
  kAlign,      ///< direct alignment: coarse to fine, Gauss-Newton on rendered images
  kKeyframes,  ///< keyframes through the images of a sequence; one image alone: as kAlign
  kInversion,  ///< the paper's parallel inversion: Adam on SO(3) x T(3) with resampling
};

/// One stage of direct alignment as a user writes it: sizes relative to the object.
struct AlignStageSettings {
  double object_px = 32;  ///< the object's diameter spans so many pixels in this stage; 48 at least
                          ///< while contrasts are compared
  int hypotheses = 64;    ///< kept in this stage
  int iterations = 10;    ///< at most
  int rays_per_side = 1;  ///< rays_per_side^2 rays a pixel
  double blur_px = 1.0;   ///< sigma of the total blur of both images
  double step_scale = 1;  ///< of the field's sample intervals along a ray: larger is coarser
};

/// Schedule of the paper's parallel inversion (Lin et al., section IV-B); the defaults are the
/// paper's and its authors'.
///
/// Lengths are in units of the NeRF Synthetic scenes, where an object spans two to three. `unit`
/// says how long one is.
struct InversionSettings {
  double unit = 0;  ///< [model units]; 0: kInversionUnitsPerDiameter to the object's diameter

  int hypotheses = 64;    ///< 1: the paper's "single", without resampling
  int first_steps = 512;  ///< free exploration
  int rounds = 4;         ///< of resampling, each followed by `round_steps` steps
  int round_steps = 512;

  double spread_rotation_rad = 0.26179938779914941;  ///< of the first hypotheses, half width per
                                                     ///< axis, about the camera; 0: the prior's
  double spread_translation = 0.3;  ///< the same for the position, axes of O; 0: the prior's

  double keep_fraction = 0.25;  ///< round k = 1.. keeps hypotheses * keep_fraction * keep_decay^k
  double keep_decay = 0.5;      ///< ... so 8, 4, 4, 4 of 64 ...
  int keep_at_least = 4;        ///< ... but at least so many
  double jitter_rotation_rad = 0.052359877559829887;  ///< half width per axis, about the camera
  double jitter_translation = 0.1;                    ///< half width per axis, axes of O, then

  int score_pixels = 16384;  ///< on which all are compared at the end, to choose the winner

  OptimisationPlan
      descent;  ///< its `length_unit` is in units here; its seed comes from the refiner

  /// Length of a unit for an object of this diameter [model units].
  double unitFor(double object_diameter) const;

  /// Hypotheses that survive the resampling before round k = 1.. .
  int survivors(int round) const;

  /// @throws std::invalid_argument naming the setting and the value that is out of range.
  void validate() const;
};

/// Objects of the NeRF Synthetic scenes measure about so many units across.
constexpr double kInversionUnitsPerDiameter = 2.5;

struct RefinerSettings {
  Method method = Method::kAlign;
  std::vector<AlignStageSettings> stages;  ///< of alignment to the field, coarse to fine
  double robust_scale = 0.1;
  /// Before an unknown background: compare contrasts with the surroundings instead of colours.
  /// Right for textured objects in any lighting; false for plain ones in the lighting of the
  /// photos.
  bool compare_contrast = true;
  bool fit_gain_bias = true;  ///< ignored before a known colour: the lighting is that of the photos

  KeyframeSearchSettings keyframes;  ///< of Method::kKeyframes
  InversionSettings inversion;       ///< of Method::kInversion

  std::uint64_t seed = 1;

  /// Presets: "align" (a wide search), "track" (from the last pose),
  /// "keyframes" (the same by keyframes), "paper", "paper_single",
  /// "inerf" (of one hypothesis, to compare with).
  /// @throws std::invalid_argument listing the names that exist.
  static RefinerSettings named(const std::string& preset);
  static std::vector<std::string> presetNames();

  /// @throws std::invalid_argument naming the setting and the value that is out of range.
  void validate() const;
};

}  // namespace nerf_pose_refiner
