// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/host_device.h"
#include "math/keyframe_alignment.h"
#include "math/robust.h"
#include "math/tone.h"

namespace nerf_pose_refiner {

/// What speaks for a pose: robust losses where there is anything to compare.
template <typename T>
struct EvidenceSums {
  T explained;  ///< as they are, and ...
  T chance;     ///< ... as they would be, had the images nothing in common
  T weight;     ///< of the points
  ToneSums<T> tone;
};

/// What points of one kind say for a pose: those of the surface, or those of the outline.
struct EvidenceOfKind {
  double explained, chance;  ///< @see EvidenceSums
  double most;               ///< weight of the points, were all of them seen
};

template <typename T>
NPR_HOST_DEVICE inline void addEvidence(const EvidenceSums<T>& other, EvidenceSums<T>* sums) {
  sums->explained += other.explained;
  sums->chance += other.chance;
  sums->weight += other.weight;
  addTone(other.tone, T(1), &sums->tone);
}

/// How bright a point is in the keyframe and in the image.
template <typename T>
struct PointBrightness {
  T rendered, observed;
};

template <typename T>
NPR_HOST_DEVICE inline void addEvidence(const PointResidual<T>& r,
                                        const PointBrightness<T>& brightness, T weight, T scale,
                                        EvidenceSums<T>* sums) {
  T squared = r.value[0] * r.value[0];
  for (int c = 1; c < 3; ++c) squared += r.value[c] * r.value[c];
  sums->explained += weight * gemanMcClure(squared, scale).value;
  sums->chance += weight * gemanMcClure(r.unrelated, scale).value;
  sums->weight += weight;
  addTone(brightness.rendered, brightness.observed, weight, &sums->tone);
}

}  // namespace nerf_pose_refiner
