// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <algorithm>
#include <cstdint>
#include <vector>

#include "backend/descriptor_index.h"
#include "math/random.h"

namespace nerf_pose_refiner {

/// Descriptors of length 1 whose numbers are positive, as SIFT's are.
inline Descriptors drawnDescriptors(int rows, int columns, std::uint64_t seed) {
  Descriptors drawn(rows, columns);
  for (int i = 0; i < rows; ++i) {
    for (int k = 0; k < columns; ++k) {
      drawn(i, k) =
          randomUniform(seed, static_cast<std::uint64_t>(i), static_cast<std::uint64_t>(k));
    }
    drawn.row(i).normalize();
  }
  return drawn;
}

/// Rows of an index, each moved by about `distance`.
inline Descriptors movedDescriptors(const Descriptors& rows, float distance, std::uint64_t seed) {
  const int columns = static_cast<int>(rows.cols());
  const Descriptors moves = drawnDescriptors(static_cast<int>(rows.rows()), columns, seed);
  Descriptors moved = rows + distance * moves;
  moved.rowwise().normalize();
  return moved;
}

/// Squared distances of all rows of an index to a query, the least first.
inline std::vector<double> sortedDistances(const Descriptors& rows, const Descriptors& queries,
                                           int query) {
  std::vector<double> squares;
  for (Eigen::Index i = 0; i < rows.rows(); ++i) {
    squares.push_back((rows.row(i) - queries.row(query)).cast<double>().squaredNorm());
  }
  std::sort(squares.begin(), squares.end());
  return squares;
}

}  // namespace nerf_pose_refiner
