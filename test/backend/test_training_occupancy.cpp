// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/training_occupancy.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <stdexcept>
#include <vector>

#include "backend/cost_counters.h"
#include "field/occupied_volume.h"
#include "support/expect_error.h"

// The occupancy grid of a training, over densities that are given by hand.

namespace nerf_pose_refiner {
namespace {

constexpr int kOccupancyCells = 16;  // along the cube
constexpr float kStep = 0.1f;        // so that an update's threshold is a density of 0.1
const float kZero[3] = {0, 0, 0}, kOne[3] = {1, 1, 1};

// What the kernels below use: they are plain functions. The tests run on one thread where this
// matters.
std::function<float(float, float, float)> density_at;
std::function<void()> on_evaluation;
thread_local const float* positions[3];

void rememberPositions(const KernelGrid&, const float* const position[3], KernelRows) {
  std::copy(position, position + 3, positions);
}

void densityByHand(const float*, float* out, int n) {
  for (int s = 0; s < n; ++s) {
    out[s] = density_at(positions[0][s], positions[1][s], positions[2][s]);
    if (on_evaluation) on_evaluation();
  }
}

FieldConfig config() {
  FieldConfig c;
  c.levels = 1;
  c.features = 1;
  c.log2_table_size = 4;
  c.density_width = 4;
  c.geometry_features = 0;
  c.colour_width = 4;
  c.sh_degree = 1;
  c.step = kStep;
  c.occupancy_resolution = kOccupancyCells;
  return c;
}

class Occupancy : public testing::Test {
 protected:
  Occupancy() : networks(config()), kernels(selectCpuKernels("baseline")) {
    kernels.encode = rememberPositions;
    kernels.exponential = densityByHand;
    on_evaluation = nullptr;
    density_at = [](float, float, float) { return 0.0f; };
    field = {&kernels, &networks, KernelGrid{networks.levels.data(), nullptr, 1, 1}};
  }

  TrainingOccupancy occupancy(const OccupancyGrid& region = {}) const {
    return TrainingOccupancy(config(), region, kZero, kOne, 3);
  }
  void update(TrainingOccupancy* grid, int step, int threads = 1) {
    grid->update(field, step, threads, &work);
  }
  OccupancyGrid dense(const TrainingOccupancy& grid, const CancellationToken& cancellation = {},
                      int threads = 1) {
    return grid.dense(field, threads, cancellation, &opacity, &work);
  }

  CpuNetworks networks;
  CpuKernels kernels;
  FieldView field;
  std::vector<float> opacity;
  CostCounters work;
};

int countOf(const OccupancyGrid& grid) {
  int count = 0;
  for (const std::uint8_t byte : grid.bits) {
    for (int bit = 0; bit < 8; ++bit) count += byte >> bit & 1;
  }
  return count;
}

TEST_F(Occupancy, FirstAllThatTouchesTheBoxIsOccupied) {
  EXPECT_EQ(countOf(occupancy().mask().fine()),
            kOccupancyCells * kOccupancyCells * kOccupancyCells);
  // x from 0.2 to 0.5 of 16 cells: from the middle of cell 3 to the end of cell 7.
  const float low[3] = {0.2f, 0, 0}, high[3] = {0.5f, 1, 1};
  const TrainingOccupancy part(config(), OccupancyGrid(), low, high, 3);
  EXPECT_EQ(countOf(part.mask().fine()), 5 * kOccupancyCells * kOccupancyCells);
  EXPECT_TRUE(part.mask().fine().occupied(3, 0, 15));
  EXPECT_FALSE(part.mask().fine().occupied(8, 0, 15));
  const float inside[3] = {0.19f, 0.5f, 0.5f}, outside[3] = {0.18f, 0.5f, 0.5f};
  EXPECT_TRUE(part.occupied(inside));
  EXPECT_FALSE(part.occupied(outside));
}

TEST_F(Occupancy, ARegionConfinesIt) {
  OccupancyGrid region{
      kOccupancyCells,
      std::vector<std::uint8_t>(kOccupancyCells * kOccupancyCells * kOccupancyCells / 8, 0)};
  region.bits[0] = 0b110;  // cells 1 and 2 of the first row
  density_at = [](float, float, float) { return 100.0f; };
  TrainingOccupancy grid = occupancy(region);
  EXPECT_EQ(countOf(grid.mask().fine()), 2);
  for (int step = 0; step < 100; ++step) update(&grid, step);
  EXPECT_EQ(countOf(grid.mask().fine()), 2);
  EXPECT_TRUE(grid.mask().fine().occupied(2, 0, 0));
  EXPECT_EQ(countOf(dense(grid)), 4 * 2 * 2);  // dilated by a cell, at the edge of the cube

  region.resolution = 8;
  expectError<std::invalid_argument>([&] { occupancy(region); }, "8 cells", "16");
}

TEST_F(Occupancy, AnUpdateLooksAtEveryEighthCell) {
  density_at = [](float, float, float) { return 100.0f; };
  TrainingOccupancy grid = occupancy();
  update(&grid, 0);
  EXPECT_EQ(countOf(grid.mask().fine()), kOccupancyCells * kOccupancyCells * kOccupancyCells / 8);
  EXPECT_EQ(work.samples,
            static_cast<std::uint64_t>(kOccupancyCells * kOccupancyCells * kOccupancyCells / 8));
  for (int step = 1; step < 200; ++step) update(&grid, step);
  EXPECT_EQ(countOf(grid.mask().fine()), kOccupancyCells * kOccupancyCells * kOccupancyCells);
}

TEST_F(Occupancy, FollowsTheDensity) {
  density_at = [](float x, float, float) { return x < 0.25f ? 0.11f : 0.09f; };
  TrainingOccupancy grid = occupancy();
  for (int step = 0; step < 400; ++step) update(&grid, step);
  for (int x = 0; x < kOccupancyCells; ++x) {
    EXPECT_EQ(grid.mask().fine().occupied(x, 7, 3), x < 4) << x;
  }
}

// 0.11 fades below 0.1 after 15 updates: 0.11 * 0.95^(14/8) = 0.10055, 0.11 * 0.95^(15/8) = 0.0999.
TEST_F(Occupancy, WhatWasSeenFades) {
  density_at = [](float, float, float) { return 0.11f; };
  TrainingOccupancy grid = occupancy();
  update(&grid, 0);
  const int seen = countOf(grid.mask().fine());
  EXPECT_GT(seen, 0);
  density_at = [](float, float, float) { return 0.0f; };
  for (int step = 1; step <= 14; ++step) update(&grid, step);
  EXPECT_EQ(countOf(grid.mask().fine()), seen);
  update(&grid, 15);
  EXPECT_EQ(countOf(grid.mask().fine()), 0);
}

// A speck around one of the eight points of cell (4, 5, 6): a quarter of the cell from its corner.
TEST_F(Occupancy, TheDenseGridFindsASpeckAndDilatesIt) {
  density_at = [](float x, float y, float z) {
    const float cell = 1.0f / kOccupancyCells;
    const bool there =
        std::fabs(x - 4.25f * cell) + std::fabs(y - 5.25f * cell) + std::fabs(z - 6.25f * cell) <
        0.2f * cell;
    return there ? 8.0f : 0.0f;
  };
  const OccupancyGrid grid = dense(occupancy());
  EXPECT_EQ(countOf(grid), 27);
  EXPECT_TRUE(grid.occupied(3, 4, 5));
  EXPECT_TRUE(grid.occupied(5, 6, 7));
  // The mean density of the cell is 1, its width 1/16: 1 - exp(-1/16).
  const std::size_t cell = (6 * kOccupancyCells + 5) * kOccupancyCells + 4;
  EXPECT_NEAR(opacity[cell], 0.0605869, 1e-6);
  EXPECT_EQ(opacity[cell + 1], 0);
  EXPECT_EQ(work.samples, 8u * kOccupancyCells * kOccupancyCells * kOccupancyCells);
}

TEST_F(Occupancy, TheDenseGridIsStricterThanTheTrainings) {
  density_at = [](float x, float, float) { return x < 0.5f ? 0.011f : 0.009f; };
  TrainingOccupancy grid = occupancy();
  for (int step = 0; step < 100; ++step) update(&grid, step);
  EXPECT_EQ(countOf(grid.mask().fine()), 0);
  EXPECT_EQ(countOf(dense(grid)),
            9 * kOccupancyCells * kOccupancyCells);  // eight layers and one of the dilation
}

TEST_F(Occupancy, ThreadsDoNotMatter) {
  density_at = [](float x, float y, float z) { return x * y + z > 0.8f ? 0.2f : 0.01f * x; };
  TrainingOccupancy alone = occupancy(), shared = occupancy();
  for (int step = 0; step < 20; ++step) {
    update(&alone, step, 1);
    update(&shared, step, 3);
  }
  EXPECT_EQ(alone.mask().fine().bits, shared.mask().fine().bits);
  EXPECT_EQ(dense(alone, CancellationToken(), 1).bits, dense(shared, CancellationToken(), 3).bits);
}

// At most one round of 2^16 points is evaluated after the cancellation: some 10 ms.
TEST_F(Occupancy, TheDenseGridCanBeStoppedOnTheWay) {
  const CancellationToken cancellation;
  std::uint64_t evaluated = 0, asked_at = 10000;
  on_evaluation = [&] {
    if (++evaluated == asked_at) cancellation.requestCancel();
  };
  FieldConfig large = config();
  large.occupancy_resolution = 64;
  const TrainingOccupancy grid(large, OccupancyGrid(), kZero, kOne, 3);
  EXPECT_THROW(dense(grid, cancellation), Cancelled);
  EXPECT_GE(evaluated, asked_at);
  EXPECT_LE(evaluated, asked_at + (1u << 16));
}

}  // namespace
}  // namespace nerf_pose_refiner
