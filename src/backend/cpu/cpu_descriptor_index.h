// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/descriptor_index.h"

namespace nerf_pose_refiner {

/// A forest of randomised kd-trees (Silpa-Anan and Hartley 2008): most of the nearest descriptors
/// are found, in a small part of the time that comparing all of them takes.
class CpuDescriptorIndex final : public DescriptorIndex {
 public:
  /// @param rows live longer. @throws std::invalid_argument for descriptors that no index is made
  /// of.
  CpuDescriptorIndex(const Descriptors& rows, int threads);
  ~CpuDescriptorIndex() override;

  std::vector<Neighbour> nearest(const Descriptors& queries, int count) override;

 private:
  struct Trees;

  const Descriptors& rows_;  // the trees point at them, too
  int threads_;
  std::unique_ptr<Trees> trees_;
};

}  // namespace nerf_pose_refiner
