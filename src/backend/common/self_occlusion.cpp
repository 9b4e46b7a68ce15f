// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/self_occlusion.h"

#include <algorithm>
#include <limits>

namespace nerf_pose_refiner {
namespace {

constexpr int kCellSpacings = 2;  // of a cell: so wide that a surface's points leave no holes
// Depth that a surface may gain within a cell, in pixels as wide as its depth makes them: what a
// keyframe shows is not steeper.
constexpr float kMargin_px = 12;

}  // namespace

const std::vector<std::int32_t>& SelfOcclusion::hidden(const PointColumns& shown,
                                                       const PointTransform<float>& pose,
                                                       const ImageFrame& image) {
  const float cell_px = static_cast<float>(kCellSpacings * image.spacing);
  const int columns = static_cast<int>(static_cast<float>(image.width) / cell_px) + 1;
  const int rows = static_cast<int>(static_cast<float>(image.height) / cell_px) + 1;
  nearest_.assign(static_cast<std::size_t>(columns) * rows, std::numeric_limits<float>::max());
  cell_.resize(shown.size());
  depth_.resize(shown.size());
  hidden_.clear();
  for (int i = 0; i < shown.size(); ++i) {
    const Vec3<float> q = inCamera(pose, Vec3<float>{shown.x[i], shown.y[i], shown.z[i]});
    const float inverse_depth = 1 / std::max(q.z, 1e-6f);
    const float u = (image.K.fx * q.x * inverse_depth + image.K.cx + 0.5f) / cell_px;
    const float v = (image.K.fy * q.y * inverse_depth + image.K.cy + 0.5f) / cell_px;
    const bool inside = u >= 0 && v >= 0 && u < static_cast<float>(columns) &&
                        v < static_cast<float>(rows) && q.z > 0;
    cell_[i] = inside ? static_cast<int>(v) * columns + static_cast<int>(u) : -1;
    depth_[i] = q.z;
  }
  for (int i = 0; i < shown.size(); ++i) {
    if (cell_[i] < 0) continue;
    float& nearest = nearest_[cell_[i]];
    nearest = std::min(nearest, depth_[i]);
  }
  const float margin = 1 + kMargin_px / image.K.fx;
  for (int i = 0; i < shown.size(); ++i) {
    if (cell_[i] >= 0 && depth_[i] > margin * nearest_[cell_[i]]) hidden_.push_back(shown.cell[i]);
  }
  return hidden_;
}

}  // namespace nerf_pose_refiner
