// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/keyframe_score.h"

#include <gtest/gtest.h>

namespace nerf_pose_refiner {
namespace {

constexpr double kRobustScale = 0.5;
constexpr Tone kAgrees = {1, 1}, kDisagrees = {0, 1}, kNoContrast = {0, 0};

/// Points that differ by a share of what chance gives. @param seen of them.
EvidenceOfKind surfaceThat(double differs, double seen = 1) {
  constexpr double kPoints = 200;
  const double chance = seen * kPoints * chanceLoss(kRobustScale);
  return {differs * chance, chance, kPoints};
}

EvidenceOfKind outlineThat(double differs, double seen = 1) {
  constexpr double kWeight = 40;
  const double chance = seen * kWeight * gemanMcClure(double{kOutlineChance}, kRobustScale).value;
  return {differs * chance, chance, kWeight};
}

double scoreOf(const EvidenceOfKind& surface, const EvidenceOfKind& outline, const Tone& tone) {
  return keyframeScore(surface, outline, tone, kRobustScale);
}

TEST(KeyframeScore, isOneIfAllAgreesAndNoneIfNothingDoes) {
  EXPECT_DOUBLE_EQ(scoreOf(surfaceThat(0), outlineThat(0), kAgrees), 1);
  EXPECT_EQ(scoreOf(surfaceThat(1), outlineThat(1), kAgrees), 0);
  EXPECT_EQ(scoreOf(surfaceThat(1.2), outlineThat(1.1), kAgrees), 0);
  EXPECT_EQ(scoreOf({}, {}, {}), 0);
}

TEST(KeyframeScore, weighsSurfaceOutlineAndTone) {
  // 0.4 * 0.5 + 0.4 * 0.75 + 0.2 * 1
  EXPECT_NEAR(scoreOf(surfaceThat(0.5), outlineThat(0.25), kAgrees), 0.7, 1e-12);
  EXPECT_NEAR(scoreOf(surfaceThat(0.5), outlineThat(0.25), kDisagrees), 0.5, 1e-12);
}

TEST(KeyframeScore, leavesOutWhatHasNothingToCompare) {
  EXPECT_NEAR(scoreOf(surfaceThat(0.5), outlineThat(0.25), kNoContrast), 0.5 / 0.8, 1e-12);
  EXPECT_NEAR(scoreOf(surfaceThat(0.5), {}, kAgrees), (0.2 + 0.2) / 0.6, 1e-12);
  EXPECT_NEAR(scoreOf({}, outlineThat(0.25), kAgrees), (0.3 + 0.2) / 0.6, 1e-12);
  // An outline of which a hundredth is seen, where 0.15 would be enough.
  const double of_outline = 0.4 * 0.01 / 0.15;
  EXPECT_NEAR(scoreOf(surfaceThat(0.5), outlineThat(0, 0.01), kAgrees),
              (0.2 + of_outline + 0.2) / (0.6 + of_outline), 1e-12);
}

/// A wall that holds the outline, or another side of the object: 0.25 is the agreement from which
/// the outline counts wholly.
TEST(KeyframeScore, believesAnOutlineAsFarAsTheSurfaceAgrees) {
  EXPECT_NEAR(scoreOf(surfaceThat(0.75), outlineThat(0.2), kAgrees), 0.1 + 0.32 + 0.2, 1e-12);
  EXPECT_NEAR(scoreOf(surfaceThat(0.9), outlineThat(0.2), kDisagrees), 0.04 + 0.4 * 0.32, 1e-12);
  EXPECT_EQ(scoreOf(surfaceThat(1), outlineThat(0.2), kAgrees), 0);
}

/// As of a white object: its surface weighs a twentieth of all; a quarter would be heard wholly.
TEST(KeyframeScore, hearsLittleOfASurfaceThatIsPlain) {
  EvidenceOfKind surface = surfaceThat(1);
  const EvidenceOfKind outline = outlineThat(0.2);
  for (double* value : {&surface.explained, &surface.chance, &surface.most}) {
    *value *= outline.most / surface.most / 19;
  }
  constexpr double kHeard = 0.05 / 0.25;
  EXPECT_NEAR(scoreOf(surface, outline, kNoContrast),
              0.4 * (1 - kHeard) * 0.8 / (0.4 * kHeard + 0.4), 1e-6);
}

TEST(KeyframeScore, isLittleWhereAWallIsAllThereIs) {
  EXPECT_NEAR(scoreOf(surfaceThat(0, 0.015), {}, kNoContrast), 0.1, 1e-12);
}

}  // namespace
}  // namespace nerf_pose_refiner
