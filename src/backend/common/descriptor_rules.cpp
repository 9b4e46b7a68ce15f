// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/descriptor_rules.h"

#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {

void requireIndexed(const Descriptors& rows) {
  if (rows.rows() == 0) throw std::invalid_argument("there are no descriptors");
  if (rows.cols() < 1 || rows.cols() > DescriptorIndex::kMostColumns) {
    throw std::invalid_argument("descriptors have " + std::to_string(rows.cols()) +
                                " columns, must have 1 to " +
                                std::to_string(DescriptorIndex::kMostColumns));
  }
}

void requireQueries(const Descriptors& queries, Eigen::Index columns, int count) {
  if (queries.cols() != columns) {
    throw std::invalid_argument("queries have " + std::to_string(queries.cols()) +
                                " columns, the descriptors " + std::to_string(columns));
  }
  if (count < 1 || count > DescriptorIndex::kMostNeighbours) {
    throw std::invalid_argument("neighbours: " + std::to_string(count) + ", must be 1 to " +
                                std::to_string(DescriptorIndex::kMostNeighbours));
  }
}

}  // namespace nerf_pose_refiner
