// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/descriptor_index.h"
#include "descriptor_search.h"
#include "device_memory.h"

namespace nerf_pose_refiner {

/// Compares queries with all descriptors, in half precision. Nothing of it is shared with what else
/// its backend does, and its stream goes last.
class CudaDescriptorIndex final : public DescriptorIndex {
 public:
  /// @param device the calling thread's. @throws std::invalid_argument for descriptors that no
  /// index is made of.
  CudaDescriptorIndex(int device, const Descriptors& rows);
  ~CudaDescriptorIndex() override;

  std::vector<Neighbour> nearest(const Descriptors& queries, int count) override;

 private:
  /// Descriptors as halves.
  struct Converted {
    DeviceBuffer<__half> values;
    DeviceBuffer<float> half_squares;
    int count = 0;  // with those that fill it up

    CudaDescriptors view() const { return {values.data(), half_squares.data(), count}; }
  };

  void convert(const Descriptors& from, int first, int count, Converted* to);

  int device_;
  Eigen::Index columns_;
  CudaStream stream_;
  DeviceBuffer<float> floats_;
  Converted rows_, queries_;
  DeviceBuffer<NearKey> of_slices_;
  DeviceBuffer<CudaNeighbour> nearest_;
  PinnedBuffer<CudaNeighbour> found_;
};

}  // namespace nerf_pose_refiner
