// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// Whether a refined pose is to be trusted, or why not.
enum class TrustVerdict {
  kTrusted,
  kNoOverlap,   ///< the start pose lies outside of the image
  kBadSize,     ///< the object would be far larger than the image, or only a few pixels wide
  kDiverged,    ///< no hypothesis survived
  kLowScore,    ///< the pose explains the image badly
  kUncertain,   ///< it is the right place, but the image does not fix the pose there
  kMistakable,  ///< the object looks the same in another pose, and which one it is in is not known
  kBadMask,     ///< the mask shows something else
  kCancelled,   ///< the refinement was interrupted
};

/// A pose that is not known from others that look alike is not trusted, however low the least score
/// is: what images say of that has been gathered already.
/// @param least_score that a pose to be trusted has, 0..1.
TrustVerdict checkTrust(const Refinement& refinement, double least_score);

/// The reason in words; empty for kTrusted.
const char* textOf(TrustVerdict verdict);

}  // namespace nerf_pose_refiner
