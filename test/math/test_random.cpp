// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <vector>

namespace nerf_pose_refiner {
namespace {

constexpr int kDraws = 1 << 16;

TEST(Random, BitsArePinned) {
  // Seed and stream 0: the published sequence of SplitMix64 from 0.
  EXPECT_EQ(randomBits(0, 0, 0), 0xe220a8397b1dcdafull);
  EXPECT_EQ(randomBits(0, 0, 1), 0x6e789e6aa1b965f4ull);
  // Worked out apart, with integers of any length modulo 2^64.
  EXPECT_EQ(randomBits(1, 0, 0), 0xa706dd2f4d197e6full);
  EXPECT_EQ(randomBits(1, 2, 3), 0x8ea264d0125c8328ull);
  EXPECT_EQ(randomBits(~0ull, ~0ull, ~0ull), 0x4dab2c1ce9210c4cull);
}

TEST(Random, UniformIsTheHighest24Bits) {
  EXPECT_EQ(randomUniform(0, 0, 0), 14819496.0f / 16777216.0f);  // 0xe220a8
  EXPECT_EQ(randomUniform(1, 2, 3), 9347684.0f / 16777216.0f);   // 0x8ea264
}

TEST(Random, IndexIsTheFractionOfN) {
  EXPECT_EQ(randomIndex(0, 0, 0, 1000), 883u);  // 0.8833
  EXPECT_EQ(randomIndex(1, 2, 3, 1000), 557u);  // 0.5572
  EXPECT_EQ(randomIndex(1, 2, 3, 1), 0u);
  EXPECT_EQ(randomIndex(0, 0, 0, 0xffffffffu), 0xe220a838u);
}

using Draw = std::function<float(std::uint64_t)>;

// Sequences in which two of the three inputs stay.
std::vector<Draw> sequences() {
  return {[](std::uint64_t i) { return randomUniform(5, 7, i); },
          [](std::uint64_t i) { return randomUniform(5, i, 7); },
          [](std::uint64_t i) { return randomUniform(i, 5, 7); }};
}

TEST(Random, EveryInputGivesAnEvenSpread) {
  constexpr int kBins = 64;
  for (const Draw& draw : sequences()) {
    std::vector<int> bins(kBins, 0);
    for (int i = 0; i < kDraws; ++i) ++bins.at(static_cast<int>(draw(i) * kBins));
    double chi_squared = 0;
    for (const int bin : bins) {
      const double expected = 1.0 * kDraws / kBins;
      chi_squared += (bin - expected) * (bin - expected) / expected;
    }
    EXPECT_LT(chi_squared, 110);  // 63 degrees of freedom: 1 in 4000
    EXPECT_GT(chi_squared, 30);   // too even is not random either
  }
}

TEST(Random, NeighboursAreUncorrelated) {
  for (const Draw& draw : sequences()) {
    for (const int away : {1, 2, 8}) {
      double sum = 0;
      for (int i = 0; i < kDraws; ++i) sum += (draw(i) - 0.5) * (draw(i + away) - 0.5);
      EXPECT_LT(std::abs(12 * sum / kDraws), 4 / std::sqrt(kDraws)) << away;
    }
  }
}

TEST(Random, InputsDoNotStandForEachOther) {
  double sum = 0;
  for (int i = 0; i < kDraws; ++i) {
    sum += (randomUniform(5, 7, i) - 0.5) * (randomUniform(5, i, 7) - 0.5);
  }
  EXPECT_LT(std::abs(12 * sum / kDraws), 4 / std::sqrt(kDraws));
}

}  // namespace
}  // namespace nerf_pose_refiner
