// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <memory>
#include <stdexcept>

#include "backend/backend.h"
#include "backend/make_backend.h"
#include "support/drawn_descriptors.h"

namespace nerf_pose_refiner {
namespace {

std::vector<Neighbour> nearestOnCpu(const Descriptors& rows, const Descriptors& queries, int count,
                                    int threads = 1) {
  return makeCpuBackend(threads)->makeDescriptorIndex(rows)->nearest(queries, count);
}

TEST(CpuDescriptorIndex, FindsHandPlacedNeighboursInOrder) {
  Descriptors rows(4, 2), queries(1, 2);
  rows << 0, 0, 3, 0, 1, 0, 0, 4;
  queries << 1, 1;
  const auto found = nearestOnCpu(rows, queries, 3);
  ASSERT_EQ(found.size(), 3u);
  EXPECT_EQ(found[0].row, 2);
  EXPECT_EQ(found[1].row, 0);
  EXPECT_EQ(found[2].row, 1);
  EXPECT_FLOAT_EQ(found[0].squared_distance, 1);
  EXPECT_FLOAT_EQ(found[1].squared_distance, 2);
  EXPECT_FLOAT_EQ(found[2].squared_distance, 5);
}

TEST(CpuDescriptorIndex, SaysWhereThereAreTooFew) {
  const Descriptors rows = drawnDescriptors(2, 8, 1);
  const auto found = nearestOnCpu(rows, drawnDescriptors(3, 8, 2), 4);
  ASSERT_EQ(found.size(), 12u);
  for (std::size_t i = 0; i < found.size(); ++i) EXPECT_EQ(found[i].row < 0, i % 4 >= 2);
}

TEST(CpuDescriptorIndex, FindsNearlyAllThatAreNear) {
  const Descriptors rows = drawnDescriptors(3000, 128, 3);
  const Descriptors queries = movedDescriptors(rows.topRows(300), 0.2f, 4);
  const auto found = nearestOnCpu(rows, queries, 1);
  int right = 0;
  for (int i = 0; i < 300; ++i) right += found[static_cast<std::size_t>(i)].row == i ? 1 : 0;
  EXPECT_GE(right, 285);
}

TEST(CpuDescriptorIndex, AnyNumberOfThreadsFindsTheSame) {
  const Descriptors rows = drawnDescriptors(500, 16, 5), queries = drawnDescriptors(100, 16, 6);
  const auto one = nearestOnCpu(rows, queries, 6, 1), four = nearestOnCpu(rows, queries, 6, 4);
  ASSERT_EQ(one.size(), 600u);
  ASSERT_EQ(one.size(), four.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].row, four[i].row);
    EXPECT_EQ(one[i].squared_distance, four[i].squared_distance);
  }
}

TEST(CpuDescriptorIndex, RefusesWhatMakesNoSense) {
  const auto backend = makeCpuBackend(1);
  const Descriptors none(0, 128), wide = drawnDescriptors(2, 129, 1),
                                  rows = drawnDescriptors(9, 8, 1);
  EXPECT_THROW(backend->makeDescriptorIndex(none), std::invalid_argument);
  EXPECT_THROW(backend->makeDescriptorIndex(wide), std::invalid_argument);
  const auto index = backend->makeDescriptorIndex(rows);
  EXPECT_THROW(index->nearest(drawnDescriptors(1, 9, 1), 1), std::invalid_argument);
  EXPECT_THROW(index->nearest(rows, 0), std::invalid_argument);
  EXPECT_THROW(index->nearest(rows, DescriptorIndex::kMostNeighbours + 1), std::invalid_argument);
  EXPECT_TRUE(index->nearest(Descriptors(0, 8), 2).empty());
}

}  // namespace
}  // namespace nerf_pose_refiner
