// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_descriptor_index.h"

#include <algorithm>
#include <cstddef>
#include <iterator>

#include "backend/common/descriptor_rules.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kMostAtOnce = 2048;  // queries, which bounds the memory that they take

static_assert(kNearRows == DescriptorIndex::kMostNeighbours,
              "kernels find as many as are asked for");
static_assert(kDescriptorColumns == DescriptorIndex::kMostColumns, "kernels take all columns");
static_assert(kQueriesPerWarp % kRowsPerTile == 0 && kMostAtOnce % kQueriesPerWarp == 0,
              "what is filled up for queries is for rows, too");

int filledUp(int count) {
  return (count + kQueriesPerWarp - 1) / kQueriesPerWarp * kQueriesPerWarp;
}

}  // namespace

CudaDescriptorIndex::CudaDescriptorIndex(int device, const Descriptors& rows)
    : device_(device), columns_(rows.cols()) {
  requireIndexed(rows);
  convert(rows, 0, static_cast<int>(rows.rows()), &rows_);
  stream_.wait();
  floats_ = {};  // queries need less
}

CudaDescriptorIndex::~CudaDescriptorIndex() {
  cudaSetDevice(device_);  // a destructor never throws
  cudaStreamSynchronize(stream_);
}

/// Enqueues it.
void CudaDescriptorIndex::convert(const Descriptors& from, int first, int count, Converted* to) {
  floats_.upload(from.data() + first * columns_, static_cast<std::size_t>(count * columns_),
                 stream_);
  to->count = filledUp(count);
  to->values.reserve(static_cast<std::size_t>(to->count) * kDescriptorColumns);
  to->half_squares.reserve(static_cast<std::size_t>(to->count));
  convertDescriptors({floats_.data(), count, static_cast<int>(columns_), to->count,
                      to->values.data(), to->half_squares.data()},
                     stream_);
}

std::vector<Neighbour> CudaDescriptorIndex::nearest(const Descriptors& queries, int count) {
  requireQueries(queries, columns_, count);
  NPR_CUDA_CHECK(cudaSetDevice(device_));
  const int all = static_cast<int>(queries.rows());
  const auto slices = static_cast<std::size_t>(descriptorSlices(rows_.count));
  std::vector<Neighbour> result;
  result.reserve(static_cast<std::size_t>(all) * static_cast<std::size_t>(count));
  for (int first = 0; first < all; first += kMostAtOnce) {
    const int now = std::min(kMostAtOnce, all - first);
    convert(queries, first, now, &queries_);
    const std::size_t results = static_cast<std::size_t>(queries_.count) * kNearRows;
    of_slices_.reserve(results * slices);
    nearest_.reserve(results);
    found_.reserve(results);
    findNearest({rows_.view(), queries_.view(), of_slices_.data(), nearest_.data()}, stream_);
    NPR_CUDA_CHECK(cudaMemcpyAsync(found_.data(), nearest_.data(), results * sizeof(CudaNeighbour),
                                   cudaMemcpyDeviceToHost, stream_));
    stream_.wait();
    for (int i = 0; i < now; ++i) {
      std::transform(found_.data() + i * kNearRows, found_.data() + i * kNearRows + count,
                     std::back_inserter(result), [](const CudaNeighbour& one) -> Neighbour {
                       return {one.row, one.squared_distance};
                     });
    }
  }
  return result;
}

}  // namespace nerf_pose_refiner
