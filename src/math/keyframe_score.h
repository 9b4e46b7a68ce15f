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
/// Clutter easily holds an outline, mostly around something plain: were surface and outline one
/// sum, the outline would make up for the pattern that is missing there.
inline double keyframeScore(const EvidenceOfKind& surface, const EvidenceOfKind& outline,
                            const Tone& tone, double robust_scale) {
  constexpr double kOfSurface = 0.4, kOfOutline = 0.4, kOfTone = 0.2;
  const double full_chance = chanceLoss(robust_scale);
  const double of_surface = kOfSurface * judgedOf(surface, full_chance);
  const double of_outline =
      kOfOutline * judgedOf(outline, gemanMcClure(double{kOutlineChance}, robust_scale).value);
  const double of_tone = kOfTone * tone.contrast;
  const double explained = of_surface * agreementOf(surface) + of_outline * agreementOf(outline);
  if (!(explained > 0)) return 0;
  const EvidenceOfKind both = {0, surface.chance + outline.chance, surface.most + outline.most};
  return (explained + of_tone * tone.agreement) / (of_surface + of_outline + of_tone) *
         judgedOf(both, full_chance);
}

}  // namespace nerf_pose_refiner
