// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/check_trust.h"

#include <gtest/gtest.h>

namespace nerf_pose_refiner {
namespace {

Refinement refinementWith(Outcome outcome, double score) {
  Refinement refinement;
  refinement.outcome = outcome;
  refinement.score = score;
  return refinement;
}

TEST(CheckTrust, AScoreThatIsJustEnoughIsTrusted) {
  EXPECT_EQ(checkTrust(refinementWith(Outcome::kRefined, 0.5), 0.5), TrustVerdict::kTrusted);
  EXPECT_EQ(checkTrust(refinementWith(Outcome::kRefined, 0.4999), 0.5), TrustVerdict::kLowScore);
}

TEST(CheckTrust, AnUncertainPoseOfWhatIsThereIsNoWrongOne) {
  Refinement refinement = refinementWith(Outcome::kRefined, 0.4);
  refinement.found_probability = 0.95;
  EXPECT_EQ(checkTrust(refinement, 0.5), TrustVerdict::kUncertain);
  refinement.found_probability = 0.45;
  EXPECT_EQ(checkTrust(refinement, 0.5), TrustVerdict::kLowScore);
}

TEST(CheckTrust, OfPosesThatLookAlikeNoneIsTrusted) {
  Refinement refinement = refinementWith(Outcome::kRefined, 0.89);
  refinement.found_probability = 0.99;
  refinement.unmistaken = 0.89;
  EXPECT_EQ(checkTrust(refinement, 0.5), TrustVerdict::kMistakable);
  refinement.unmistaken = 0.91;
  EXPECT_EQ(checkTrust(refinement, 0.5), TrustVerdict::kTrusted);
  refinement.found_probability = 0.4;  // it may not be there at all
  EXPECT_EQ(checkTrust(refinement, 0.5), TrustVerdict::kLowScore);
}

TEST(CheckTrust, WithoutAPoseNoScoreHelps) {
  EXPECT_EQ(checkTrust(refinementWith(Outcome::kNoOverlap, 1), 0), TrustVerdict::kNoOverlap);
  EXPECT_EQ(checkTrust(refinementWith(Outcome::kDiverged, 1), 0), TrustVerdict::kDiverged);
  EXPECT_EQ(checkTrust(refinementWith(Outcome::kCancelled, 1), 0), TrustVerdict::kCancelled);
}

}  // namespace
}  // namespace nerf_pose_refiner
