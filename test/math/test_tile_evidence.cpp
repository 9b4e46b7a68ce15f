// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/tile_evidence.h"

#include <gtest/gtest.h>

namespace nerf_pose_refiner {
namespace {

constexpr double kFull = 0.25;  // loss of a point of full contrast by chance

/// 10 points of full contrast. @param agreement 1: as rendered, 0: by chance.
EvidenceSums<float> tileWith(float agreement) { return {2.5f * (1 - agreement), 2.5f, 10, {}}; }

TEST(TileEvidence, TilesThatAgreeAreSeen) {
  TileEvidence evidence;
  evidence.addTile(tileWith(0.9f), kFull);
  evidence.addTile(tileWith(0.8f), kFull);
  evidence.addTile(tileWith(0.0f), kFull);
  evidence.addTile(tileWith(-0.5f), kFull);  // worse than by chance
  EXPECT_DOUBLE_EQ(evidence.judged, 40);
  EXPECT_NEAR(evidence.visibleFraction(), 0.5, 1e-6);
}

TEST(TileEvidence, HalfwayAgreementIsSeenInPart) {
  TileEvidence evidence;
  evidence.addTile(tileWith(0.5f * (kMinSeenAgreement + kWhollySeenAgreement)), kFull);
  EXPECT_NEAR(evidence.visibleFraction(), 0.5, 1e-6);
}

TEST(TileEvidence, PlainTilesSayLittle) {
  TileEvidence evidence;
  evidence.addTile(tileWith(0.9f), kFull);
  // A tenth of the contrast that counts in full, and covered.
  const auto chance = static_cast<float>(0.1 * kJudgedContrast * 2.5);
  evidence.addTile({chance, chance, 10, {}}, kFull);
  EXPECT_NEAR(evidence.judged, 11, 1e-5);
  EXPECT_NEAR(evidence.visibleFraction(), 10.0 / 11, 1e-6);
}

TEST(TileEvidence, WithoutAnythingToJudgeNothingIsSeen) {
  TileEvidence evidence;
  evidence.addTile({0, 0, 10, {}}, kFull);
  EXPECT_EQ(evidence.visibleFraction(), 0);
}

TEST(TileEvidence, WhatHidesTheObjectHasNoPartInItsTone) {
  EvidenceSums<float> seen = tileWith(0.9f), half = tileWith(0.275f), hidden = tileWith(0.1f);
  for (EvidenceSums<float>* tile : {&seen, &half, &hidden}) {
    addTone(0.2f, 0.4f, 5.0f, &tile->tone);
    addTone(0.6f, 0.8f, 5.0f, &tile->tone);
  }
  addTone(1.0f, 0.0f, 100.0f, &hidden.tone);
  TileEvidence evidence;
  for (const EvidenceSums<float>& tile : {seen, half, hidden}) evidence.addTile(tile, kFull);
  EXPECT_NEAR(evidence.tone.weight, 10 + 5, 1e-4);
  EXPECT_NEAR(evidence.tone.rendered, 4 + 2, 1e-4);
  EXPECT_NEAR(evidence.tone.observed, 6 + 3, 1e-4);
}

TEST(TileEvidence, PartsAddUp) {
  TileEvidence one, other, both;
  one.addTile(tileWith(0.9f), kFull);
  other.addTile(tileWith(0.2f), kFull);
  both.addTile(tileWith(0.9f), kFull);
  both.addTile(tileWith(0.2f), kFull);
  one.add(other);
  EXPECT_EQ(one.judged, both.judged);
  EXPECT_EQ(one.seen, both.seen);
  EXPECT_EQ(one.tone.weight, both.tone.weight);
}

}  // namespace
}  // namespace nerf_pose_refiner
