// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "field/field.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// What an object may be taken for beside what its symmetries, which may have been told after it
/// was registered, allow anyway.
LookAlikes beyondSymmetries(LookAlikes look_alikes, const Symmetries& symmetries);

/// How far apart poses may be that count as the same.
struct PoseBounds {
  double rotation_rad;
  double offset;  ///< of the object's centre [diameters]
};

/// Whether an object in one pose is, or may be taken for being, in another one: after its
/// symmetries, and what looks alike.
bool mayBeTakenFor(const Pose& a_T_O_C, const Pose& b_T_O_C, const FieldMetadata& object,
                   const LookAlikes& look_alikes, const PoseBounds& bounds);

/// A pose, or one that it may be taken for: the one whose rotation is nearest to a reference's.
Pose nearestLookAlike(const Pose& T_O_C, const Pose& reference_T_O_C,
                      const LookAlikes& look_alikes);

/// Size of renderings that are compared with images, @see PoseEvidence [px a diameter].
constexpr int kEvidence_px = 80;

/// Deviation of colours that right poses of an object leave unexplained, @see PoseEvidence::of.
double noiseOf(const FieldMetadata& object);

/// Turns about an axis that are tried: coarse ones to find another pose, fine ones to see how well
/// the image fixes the turn. Sorted, from -180 to 180 degrees, both of which are there; 0 is.
const std::vector<double>& triedTurns_rad();

/// Motions of an object to what it may be taken for, 30 degrees apart about an axis.
std::vector<Pose> coarseMotions(const LookAlikes& look_alikes);

}  // namespace nerf_pose_refiner
