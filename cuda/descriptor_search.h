// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_fp16.h>
#include <cuda_runtime_api.h>

#include <cstdint>

namespace nerf_pose_refiner {

constexpr int kDescriptorColumns = 128;  // on the device: others are filled up with zeros
constexpr int kNearRows = 8;             // rows that are found for each query
constexpr int kRowsPerTile = 8;          // of a product on the tensor cores
constexpr int kQueriesPerWarp = 16;
constexpr int kRowsPerSlice = 1024;  // that one warp looks at

/// Descriptors on the device.
struct CudaDescriptors {
  const __half* values;       ///< [count][kDescriptorColumns]
  const float* half_squares;  ///< [count]: half of each one's squared length; infinite: no row
  int count;
};

/// A near row with its score, as a number: nearer ones are larger, and of equally near ones the
/// first.
using NearKey = std::uint64_t;

/// A row that is nearest to a query.
struct CudaNeighbour {
  int row;  ///< -1: there are not as many
  float squared_distance;
};

/// Queries that are compared with all rows.
struct DescriptorTask {
  CudaDescriptors rows;     ///< a multiple of kRowsPerTile
  CudaDescriptors queries;  ///< a multiple of kQueriesPerWarp
  NearKey* of_slices;       ///< [queries][slices of the rows][kNearRows]: scratch
  CudaNeighbour* nearest;   ///< [queries][kNearRows], nearest first: the result
};

inline int descriptorSlices(int rows) { return (rows + kRowsPerSlice - 1) / kRowsPerSlice; }

/// Descriptors of floats as halves.
struct DescriptorConversion {
  const float* from;  ///< [count][columns]
  int count, columns;
  int padded;           ///< rows that are written; those beyond `count` are no rows
  __half* values;       ///< [padded][kDescriptorColumns]
  float* half_squares;  ///< [padded]
};

/// Enqueues it.
void convertDescriptors(const DescriptorConversion& conversion, cudaStream_t stream);

/// Enqueues it. Its blocks are short, so that streams that go first need not wait for all of them.
void findNearest(const DescriptorTask& task, cudaStream_t stream);

}  // namespace nerf_pose_refiner
