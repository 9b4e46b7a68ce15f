// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>

#include "math/keyframe_evidence.h"
#include "math/keyframe_search.h"
#include "math/outline_alignment.h"
#include "math/tone.h"

namespace nerf_pose_refiner {

/// How much less an image differs from a keyframe than by chance, 0..1.
inline double agreementOf(const EvidenceOfKind& kind) {
  return kind.chance > 0 ? std::max(0.0, 1 - kind.explained / kind.chance) : 0;
}

/// Whether there is anything to differ, 0..1: a wall is no evidence for a plain object.
/// @param full_chance loss by chance of a point of full contrast.
inline double judgedOf(const EvidenceOfKind& kind, double full_chance) {
  constexpr double kMin = 0.15;  // of what points of full contrast would give
  return kind.most > 0 ? std::min(1.0, kind.chance / (kMin * kind.most * full_chance)) : 0;
}

/// How well a pose explains an image, 0..1: by surface, outline and tone, each as far as there is
/// anything to compare.
///
/// Clutter easily holds an outline, mostly around something plain, and another side of the object
/// may have the same one: where the surface says so, the outline proves little. Of an object that
/// is nearly all outline the surface says little: its points differ by noise alone.
inline double keyframeScore(const EvidenceOfKind& surface, const EvidenceOfKind& outline,
                            const Tone& tone, double robust_scale) {
  constexpr double kOfSurface = 0.4, kOfOutline = 0.4, kOfTone = 0.2;
  constexpr double kHeardShare = 0.25;  // of the points' weight, from which the surface counts
  constexpr double kAgrees = 0.25;      // its agreement from which the outline does
  const double full_chance = chanceLoss(robust_scale);
  const EvidenceOfKind both = {0, surface.chance + outline.chance, surface.most + outline.most};
  const double share = both.most > 0 ? surface.most / both.most : 0;
  const double heard = std::min(1.0, share / kHeardShare) * judgedOf(surface, full_chance);
  const double agreement = agreementOf(surface);
  const double believed = 1 - heard * (1 - std::min(1.0, agreement / kAgrees));
  const double of_surface = kOfSurface * heard;
  const double of_outline =
      kOfOutline * judgedOf(outline, gemanMcClure(double{kOutlineChance}, robust_scale).value);
  const double of_tone = kOfTone * tone.contrast;
  const double explained = of_surface * agreement + of_outline * believed * agreementOf(outline);
  if (!(explained > 0)) return 0;
  return (explained + of_tone * tone.agreement) / (of_surface + of_outline + of_tone) *
         judgedOf(both, full_chance);
}

}  // namespace nerf_pose_refiner
