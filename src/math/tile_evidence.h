// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "math/host_device.h"
#include "math/keyframe_evidence.h"

namespace nerf_pose_refiner {

/// Agreement of a tile, 1 where it looks as rendered and 0 by chance, from which on it is taken to
/// show the object in part, and wholly.
constexpr double kMinSeenAgreement = 0.15, kWhollySeenAgreement = 0.4;
/// A tile with less to compare, of what full contrast gives, says in part whether it is seen.
constexpr double kJudgedContrast = 0.2;

/// How much of an object an image shows: sums over its tiles. A single pixel may look right by
/// chance; a tile hardly does.
struct TileEvidence {
  double judged = 0;           ///< weight of points in tiles that have anything to compare
  double seen = 0;             ///< of these: in tiles that look as rendered
  ToneSums<double> tone = {};  ///< of those: what hides the object has another

  /// @param full_chance loss of a point of full contrast by chance, @see chanceLoss.
  NPR_HOST_DEVICE void addTile(const EvidenceSums<float>& tile, double full_chance) {
    if (!(tile.weight > 0 && tile.chance > 0)) return;
    const double contrast = tile.chance / (tile.weight * full_chance * kJudgedContrast);
    const double weight = tile.weight * (contrast < 1 ? contrast : 1);
    const double agreement = 1 - tile.explained / tile.chance;
    const double share =
        (agreement - kMinSeenAgreement) / (kWhollySeenAgreement - kMinSeenAgreement);
    judged += weight;
    const double seen_share = share < 0 ? 0 : share > 1 ? 1 : share;
    seen += weight * seen_share;
    addTone(tile.tone, seen_share, &tone);
  }

  NPR_HOST_DEVICE void add(const TileEvidence& other) {
    judged += other.judged;
    seen += other.seen;
    addTone(other.tone, 1.0, &tone);
  }

  /// Of what can be judged. 0: nothing can.
  double visibleFraction() const { return judged > 0 ? seen / judged : 0; }
};

}  // namespace nerf_pose_refiner
