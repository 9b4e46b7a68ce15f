// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "field/occupied_volume.h"

#include <gtest/gtest.h>

#include <cmath>
#include <tuple>
#include <vector>

namespace nerf_pose_refiner {
namespace {

using Cell = std::tuple<int, int, int>;

constexpr int kCells = 8;  // along the cube

// A box of 4 x 2 x 4 units: the cube is [-1, 3] x [-2, 2] x [0, 4], its cells are half a unit wide.
Field emptyField() {
  Field field;
  field.config.occupancy_resolution = kCells;
  field.box.min = {-1, -1, 0};
  field.box.max = {3, 1, 4};
  return field;
}

class Opacities {
 public:
  Opacities() : values_(kCells * kCells * kCells, 0.0f) {}
  void set(int x, int y, int z, float opacity) { values_[(z * kCells + y) * kCells + x] = opacity; }
  OccupiedExtent evaluate() const { return measureOccupiedVolume(emptyField(), values_); }

 private:
  std::vector<float> values_;
};

void expectCentre(const OccupiedExtent& extent, double x, double y, double z) {
  EXPECT_NEAR(extent.centre.x(), x, 1e-6);
  EXPECT_NEAR(extent.centre.y(), y, 1e-6);
  EXPECT_NEAR(extent.centre.z(), z, 1e-6);
}

// The widest of many directions misses the true one by half a percent at most.
void expectDiameter(const OccupiedExtent& extent, double diameter) {
  EXPECT_LE(extent.diameter, diameter * (1 + 1e-9));
  EXPECT_GE(extent.diameter, diameter * 0.995);
}

TEST(MeasureMatter, TwoCells) {
  Opacities cells;
  cells.set(1, 4, 2, 1.0f);  // centre (-0.25, 0.25, 1.25)
  cells.set(7, 4, 2, 0.5f);  // centre (2.75, 0.25, 1.25)
  expectCentre(cells.evaluate(), 0.75, 0.25, 1.25);
  expectDiameter(cells.evaluate(), 3 + 0.5);  // half a cell at each end
}

TEST(MeasureMatter, CellsApartInEveryDirection) {
  for (int corner = 0; corner < 4; ++corner) {  // the four diagonals of the cube
    Opacities cells;
    const int x = corner & 1 ? 7 : 0, y = corner & 2 ? 7 : 0;
    cells.set(x, y, 0, 0.9f);
    cells.set(7 - x, 7 - y, 7, 0.9f);
    expectCentre(cells.evaluate(), 1, 0, 2);
    expectDiameter(cells.evaluate(), 3.5 * std::sqrt(3.0) + 0.5);
  }
}

TEST(MeasureMatter, Box) {
  Opacities cells;
  for (int z = 1; z < 7; ++z) {
    for (int y = 3; y < 5; ++y) {
      for (int x = 2; x < 5; ++x) cells.set(x, y, z, 0.8f);
    }
  }
  expectCentre(cells.evaluate(), 0.75, 0, 2);
  expectDiameter(cells.evaluate(), 0.5 * std::sqrt(4 + 1 + 25.0) + 0.5);
}

TEST(MeasureMatter, HazeIsNoMatter) {
  Opacities cells;
  cells.set(1, 4, 2, 0.6f);
  cells.set(1, 4, 4, 0.6f);
  cells.set(7, 7, 7, 0.49f);
  expectCentre(cells.evaluate(), -0.25, 0.25, 1.75);
  expectDiameter(cells.evaluate(), 1 + 0.5);
}

TEST(MeasureMatter, OneCellIsAsWideAsACell) {
  Opacities cells;
  cells.set(0, 0, 0, 1.0f);
  expectDiameter(cells.evaluate(), 0.5);
}

TEST(MeasureMatter, NothingHasNoDiameter) {
  EXPECT_EQ(Opacities().evaluate().diameter, 0);
  expectCentre(Opacities().evaluate(), 0, 0, 0);
}

OccupancyGrid gridOf(const std::vector<Cell>& cells) {
  OccupancyGrid grid{kCells, std::vector<std::uint8_t>(kCells * kCells * kCells / 8, 0)};
  for (const auto& [x, y, z] : cells) {
    grid.bits[z * kCells + y] |= static_cast<std::uint8_t>(1 << x);  // a byte is a row of eight
  }
  return grid;
}

/// All cells from one corner to the opposite one, both included.
std::vector<Cell> box(const Cell& low, const Cell& high) {
  const auto [x0, y0, z0] = low;
  const auto [x1, y1, z1] = high;
  std::vector<Cell> cells;
  for (int z = z0; z <= z1; ++z) {
    for (int y = y0; y <= y1; ++y) {
      for (int x = x0; x <= x1; ++x) cells.emplace_back(x, y, z);
    }
  }
  return cells;
}

TEST(Dilated, ACellInside) {
  EXPECT_EQ(dilated(gridOf({{3, 4, 5}})).bits, gridOf(box({2, 3, 4}, {4, 5, 6})).bits);
  EXPECT_EQ(dilated(gridOf({{3, 4, 5}})).resolution, kCells);
}

TEST(Dilated, CellsAtTheBorder) {
  EXPECT_EQ(dilated(gridOf({{0, 0, 0}})).bits, gridOf(box({0, 0, 0}, {1, 1, 1})).bits);
  EXPECT_EQ(dilated(gridOf({{7, 7, 7}})).bits, gridOf(box({6, 6, 6}, {7, 7, 7})).bits);
  EXPECT_EQ(dilated(gridOf({{7, 3, 0}})).bits, gridOf(box({6, 2, 0}, {7, 4, 1})).bits);
}

TEST(Dilated, UnionOfNeighbourhoods) {
  std::vector<Cell> both = box({1, 3, 4}, {3, 5, 6});
  for (const Cell& cell : box({4, 4, 4}, {6, 6, 6})) both.push_back(cell);
  EXPECT_EQ(dilated(gridOf({{2, 4, 5}, {5, 5, 5}})).bits, gridOf(both).bits);
}

TEST(Dilated, EmptyStaysEmptyAndFullStaysFull) {
  EXPECT_EQ(dilated(gridOf({})).bits, gridOf({}).bits);
  const OccupancyGrid full = gridOf(box({0, 0, 0}, {7, 7, 7}));
  EXPECT_EQ(dilated(full).bits, full.bits);
}

}  // namespace
}  // namespace nerf_pose_refiner
