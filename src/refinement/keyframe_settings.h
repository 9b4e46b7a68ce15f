// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "backend/keyframe_aligner.h"
#include "refinement/keyframe_set.h"
#include "views/keyframe.h"
#include "views/view_bank.h"

namespace nerf_pose_refiner {

/// How an object is followed by keyframes.
struct KeyframeSearchSettings {
  KeyframeSettings keyframe;
  KeyframeAlignmentSettings alignment;
  double renew_rotation_deg = 8;   ///< viewpoints farther from any keyframe get one of their own
  double renew_distance = 0.12;    ///< the same of the distance, relative
  double reach_rotation_deg = 25;  ///< keyframes farther off cannot be aligned
  double reach_distance = 0.6;     ///< the same of the distance, relative
  double renewal_s = 0.12;         ///< from a request until its keyframe is used, by the stamps
  int max_keyframes = 40;          ///< kept; the one that was not used for longest goes first
  double doubtful_score = 0.35;    ///< a raw score that is lower makes the search wider, as does
                                   ///< one that wrong poses of the object often have
  int wide_starts = 24;            ///< of that search, around the prior
  ViewBankSettings bank;           ///< where the search from an initial pose begins
  int starts = 256;                ///< of that search
  int starts_further = 1024;       ///< of the next one, where what it finds is not clear
  int starts_again = 96;           ///< of the first one for an object that was lost, in each image
  /// Images come as fast as they are taken: none waits for a keyframe that comes late. (A camera
  /// whose images are renewal_s apart is slow enough for a keyframe of the image that was taken
  /// last; that one waits for it.) False: they come from a file, and each keyframe is used from the
  /// same image on, whenever it is done.
  bool real_time = true;

  /// Whether a pose wants a keyframe of its own. @param away from the nearest one, if there is any.
  bool wantsKeyframe(const std::optional<ViewDistance>& away) const;

  /// @throws std::invalid_argument naming the value that is out of range.
  void validate() const;
};

}  // namespace nerf_pose_refiner
