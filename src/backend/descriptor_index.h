// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

namespace nerf_pose_refiner {

/// Descriptors of local features, one in a row.
using Descriptors = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// A descriptor of an index that is near to one that is looked for.
struct Neighbour {
  int row = -1;                ///< of the index; -1: fewer were found
  float squared_distance = 0;  ///< Euclidean
};

/// Descriptors among which the nearest ones to others are looked for. One caller at a time; it may
/// be used beside all else that its backend made.
class DescriptorIndex {
 public:
  static constexpr int kMostNeighbours = 8;
  static constexpr int kMostColumns = 128;  ///< those of SIFT

  virtual ~DescriptorIndex() = default;

  /// The nearest descriptors to each query, nearest first: [queries][count].
  /// @throws std::invalid_argument for queries with another number of columns, and for a count that
  /// is not in 1..kMostNeighbours.
  virtual std::vector<Neighbour> nearest(const Descriptors& queries, int count) = 0;
};

}  // namespace nerf_pose_refiner
