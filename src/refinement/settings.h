// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "backend/plans.h"
#include "math/angle.h"
#include "refinement/keyframe_settings.h"

namespace nerf_pose_refiner {

/// The method of the search.
enum class Method {
  kAlign,      ///< direct alignment: coarse to fine, Gauss-Newton on rendered images
  kKeyframes,  ///< keyframes, for the images of a sequence; as kAlign for a single image
  kInversion,  ///< the paper's parallel inversion: Adam on SO(3) x T(3) with resampling
};

/// One stage of direct alignment in the settings: sizes are relative to the object.
struct AlignStageSettings {
  double object_px = 32;  ///< object diameter in this stage's image [px]; at least 48 while
                          ///< contrast is compared
  int hypotheses = 64;    ///< number in this stage
  int iterations = 10;    ///< at most
  int rays_per_side = 1;  ///< rays_per_side^2 rays per pixel
  double blur_px = 1.0;   ///< sigma of the total blur of both images
  double step_scale = 1;  ///< multiplies the field's sample intervals: larger is coarser
};

/// Schedule of the paper's parallel inversion (Lin et al., section IV-B). The defaults are those of
/// the paper and its authors' code.
///
/// Lengths are in units of the NeRF Synthetic scenes, where an object has a diameter of two to
/// three. `unit` is the length of one such unit.
struct InversionSettings {
  double unit = 0;  ///< [model units]; 0: kInversionUnitsPerDiameter to the object's diameter

  int hypotheses = 64;    ///< 1: the paper's "single", without resampling
  int first_steps = 512;  ///< free exploration
  int rounds = 4;         ///< of resampling, each followed by `round_steps` steps
  int round_steps = 512;

  double spread_rotation_rad = 15 * kDegree;  ///< of the first hypotheses, half width per axis,
                                              ///< about the camera; 0: the prior's
  double spread_translation = 0.3;  ///< the same for the position, axes of O; 0: the prior's

  double keep_fraction = 0.25;  ///< round k = 1.. keeps hypotheses * keep_fraction * keep_decay^k
  double keep_decay = 0.5;      ///< ... so 8, 4, 4, 4 of 64 ...
  int keep_at_least = 4;        ///< ... but at least this number
  double jitter_rotation_rad = 3 * kDegree;  ///< half width per axis, about the camera
  double jitter_translation = 0.1;           ///< half width per axis, axes of O

  int score_pixels = 16384;  ///< on which the winner is chosen at the end

  OptimisationPlan descent;  ///< its `length_unit` is in these units; its seed is not used

  /// Length of a unit for an object of this diameter [model units].
  double unitFor(double object_diameter) const;

  /// Number of hypotheses that survive the resampling before round k = 1, 2, ...
  int survivors(int round) const;

  /// @throws std::invalid_argument naming the setting and the value that is out of range.
  void validate() const;
};

/// Approximate diameter of the objects of the NeRF Synthetic scenes [units].
constexpr double kInversionUnitsPerDiameter = 2.5;

struct RefinerSettings {
  Method method = Method::kAlign;
  std::vector<AlignStageSettings> stages;  ///< of kAlign, coarse to fine
  double robust_scale = 0.1;
  /// If the background is unknown: compare local contrast instead of colours. Suits textured
  /// objects in any lighting; false suits plain ones in the lighting of the photos.
  bool compare_contrast = true;
  bool fit_gain_bias =
      true;  ///< not if the background's colour is known: the lighting is then that of the photos

  KeyframeSearchSettings keyframes;  ///< of Method::kKeyframes
  InversionSettings inversion;       ///< of Method::kInversion

  std::uint64_t seed = 1;

  /// Presets: "align" (a wide search), "track" (from the last pose), "keyframes" (both with
  /// keyframes), "paper", "paper_single", "inerf" (one hypothesis, for comparison).
  /// @throws std::invalid_argument listing the names that exist.
  static RefinerSettings named(const std::string& preset);
  static std::vector<std::string> presetNames();

  /// @throws std::invalid_argument naming the setting and the value that is out of range.
  void validate() const;
};

}  // namespace nerf_pose_refiner
