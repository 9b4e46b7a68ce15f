// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/hash.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <vector>

namespace nerf_pose_refiner {
namespace {

TEST(GridIndex, DenseLevelsCountXFastest) {
  // 5 vertices along an axis of 4 cells: 1 + 5 (2 + 5 * 3)
  EXPECT_EQ(denseIndex(1, 2, 3, 4), 86u);
  EXPECT_EQ(denseIndex(0, 0, 0, 4), 0u);
  EXPECT_EQ(denseIndex(4, 4, 4, 4), 124u);
}

TEST(GridIndex, DenseVerticesHaveEntriesOfTheirOwn) {
  std::vector<int> uses(6 * 6 * 6, 0);
  for (std::uint32_t z = 0; z <= 5; ++z) {
    for (std::uint32_t y = 0; y <= 5; ++y) {
      for (std::uint32_t x = 0; x <= 5; ++x) ++uses.at(denseIndex(x, y, z, 5));
    }
  }
  EXPECT_EQ(std::count(uses.begin(), uses.end(), 1), 216);
}

TEST(GridIndex, HashByHand) {
  // 2654435761 = 0x9e3779b1 and 805459861 = 0x30025795, cut to 11 bits: 0x1b1 and 0x795.
  EXPECT_EQ(hashedIndex(1, 0, 0, 2048), 1u);
  EXPECT_EQ(hashedIndex(0, 1, 0, 2048), 0x1b1u);
  EXPECT_EQ(hashedIndex(0, 0, 1, 2048), 0x795u);
  // 3 ^ 2 * 0x9e3779b1 ^ 0x30025795, the product modulo 2^32: 3 ^ 0x3c6ef362 ^ 0x30025795
  EXPECT_EQ(hashedIndex(3, 2, 1, 2048), 0x4f4u);
  EXPECT_EQ(hashedIndex(3, 2, 1, 1u << 24), 0x6ca4f4u);
}

TEST(GridIndex, HashFillsTheTableEvenly) {
  constexpr std::uint32_t kEntries = 1024;
  std::vector<int> uses(kEntries, 0);
  for (std::uint32_t z = 0; z < 40; ++z) {
    for (std::uint32_t y = 0; y < 40; ++y) {
      for (std::uint32_t x = 0; x < 40; ++x) ++uses.at(hashedIndex(x, y, z, kEntries));
    }
  }
  // 62.5 vertices an entry
  EXPECT_GT(*std::min_element(uses.begin(), uses.end()), 30);
  EXPECT_LT(*std::max_element(uses.begin(), uses.end()), 125);
}

}  // namespace
}  // namespace nerf_pose_refiner
