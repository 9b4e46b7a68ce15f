// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <algorithm>
#include <limits>
#include <stdexcept>
#include <vector>

#include "backend/backend.h"
#include "backend/descriptor_index.h"
#include "cuda_test.h"
#include "support/drawn_descriptors.h"

// Descriptors found on the GPU against a comparison of all in double precision.

namespace nerf_pose_refiner {
namespace {

/// Of squared distances between rows of length 1, of which numbers are rounded to half precision.
constexpr double kRounding = 5e-4;

class CudaDescriptorIndex : public CudaTest {
 protected:
  /// Each rank's distance is that of the rank, and the row's own.
  void expectNearest(const Descriptors& rows, const Descriptors& queries, int count) {
    const std::vector<Neighbour> found = cuda->makeDescriptorIndex(rows)->nearest(queries, count);
    ASSERT_EQ(found.size(), static_cast<std::size_t>(queries.rows() * count));
    for (int i = 0; i < queries.rows(); ++i) {
      const std::vector<double> squares = sortedDistances(rows, queries, i);
      std::vector<int> seen;
      for (int rank = 0; rank < count; ++rank) {
        const Neighbour& one = found[static_cast<std::size_t>(i * count + rank)];
        if (rank >= rows.rows()) {
          EXPECT_EQ(one.row, -1);
          continue;
        }
        ASSERT_GE(one.row, 0);
        ASSERT_LT(one.row, rows.rows());
        const double own = (rows.row(one.row) - queries.row(i)).cast<double>().squaredNorm();
        ASSERT_NEAR(one.squared_distance, own, kRounding) << "query " << i << ", rank " << rank;
        ASSERT_NEAR(own, squares[static_cast<std::size_t>(rank)], kRounding);
        EXPECT_EQ(std::count(seen.begin(), seen.end(), one.row), 0) << "each is found once";
        seen.push_back(one.row);
      }
    }
  }
};

TEST_F(CudaDescriptorIndex, FindsTheNearestOfAnyNumber) {
  // Fewer than are wanted, parts of tiles, parts and several of slices.
  for (const int rows : {1, 7, 8, 100, 1024, 1025, 4100}) {
    SCOPED_TRACE(rows);
    expectNearest(drawnDescriptors(rows, 128, 1), drawnDescriptors(33, 128, 2), 6);
  }
}

TEST_F(CudaDescriptorIndex, LooksForAnyNumberOfQueries) {
  const Descriptors rows = drawnDescriptors(300, 128, 3);
  for (const int queries : {1, 16, 17, 2048, 2050}) {
    SCOPED_TRACE(queries);
    expectNearest(rows, drawnDescriptors(queries, 128, 4), 3);
  }
  EXPECT_TRUE(cuda->makeDescriptorIndex(rows)->nearest(Descriptors(0, 128), 3).empty());
}

TEST_F(CudaDescriptorIndex, TakesDescriptorsWithFewerColumns) {
  for (const int columns : {1, 2, 64, 100}) {
    SCOPED_TRACE(columns);
    expectNearest(drawnDescriptors(50, columns, 5), drawnDescriptors(20, columns, 6), 8);
  }
}

TEST_F(CudaDescriptorIndex, OfEquallyNearOnesTheFirstAreFound) {
  const Descriptors one = drawnDescriptors(1, 128, 7);
  const Descriptors rows = one.replicate(2500, 1);
  const auto found = cuda->makeDescriptorIndex(rows)->nearest(one, 8);
  for (int rank = 0; rank < 8; ++rank) EXPECT_EQ(found[static_cast<std::size_t>(rank)].row, rank);
}

TEST_F(CudaDescriptorIndex, FindsWhatTheCpuFinds) {
  const Descriptors rows = drawnDescriptors(3000, 128, 8);
  const Descriptors queries = movedDescriptors(rows.topRows(300), 0.2f, 9);
  const auto on_cuda = cuda->makeDescriptorIndex(rows)->nearest(queries, 1);
  const auto on_cpu = cpu->makeDescriptorIndex(rows)->nearest(queries, 1);
  int same = 0;
  for (std::size_t i = 0; i < on_cuda.size(); ++i) {
    EXPECT_EQ(on_cuda[i].row, static_cast<int>(i)) << "it is the one that was moved";
    same += on_cuda[i].row == on_cpu[i].row ? 1 : 0;
  }
  EXPECT_GE(same, 285) << "the CPU's search is approximate";
}

TEST_F(CudaDescriptorIndex, QueriesThatAreNoNumbersFindNothing) {
  const Descriptors rows = drawnDescriptors(40, 128, 10);
  Descriptors queries = drawnDescriptors(2, 128, 11);
  queries(0, 5) = std::numeric_limits<float>::quiet_NaN();
  const auto found = cuda->makeDescriptorIndex(rows)->nearest(queries, 2);
  EXPECT_EQ(found[0].row, -1);
  EXPECT_EQ(found[1].row, -1);
  EXPECT_GE(found[2].row, 0) << "the other one does not mind";
}

TEST_F(CudaDescriptorIndex, RefusesWhatMakesNoSense) {
  const Descriptors rows = drawnDescriptors(9, 8, 1);
  EXPECT_THROW(cuda->makeDescriptorIndex(Descriptors(0, 128)), std::invalid_argument);
  EXPECT_THROW(cuda->makeDescriptorIndex(drawnDescriptors(2, 129, 1)), std::invalid_argument);
  const auto index = cuda->makeDescriptorIndex(rows);
  EXPECT_THROW(index->nearest(drawnDescriptors(1, 9, 1), 1), std::invalid_argument);
  EXPECT_THROW(index->nearest(rows, 0), std::invalid_argument);
  EXPECT_THROW(index->nearest(rows, DescriptorIndex::kMostNeighbours + 1), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
