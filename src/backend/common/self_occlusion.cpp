// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/self_occlusion.h"

#include <algorithm>
#include <limits>

#include "math/keyframe_search.h"

namespace nerf_pose_refiner {

const std::vector<std::int32_t>& SelfOcclusion::hidden(const PointColumns& shown,
                                                       const PointTransform<float>& pose,
                                                       const ImageFrame& image) {
  const OcclusionGrid grid = occlusionGrid(image.width, image.height, image.spacing);
  nearest_.assign(static_cast<std::size_t>(grid.columns) * grid.rows,
                  std::numeric_limits<float>::max());
  cell_.resize(shown.size());
  depth_.resize(shown.size());
  hidden_.clear();
  for (int i = 0; i < shown.size(); ++i) {
    const Vec3<float> q = inCamera(pose, Vec3<float>{shown.x[i], shown.y[i], shown.z[i]});
    cell_[i] = occlusionCell(grid, image.K, q);
    depth_[i] = q.z;
  }
  for (int i = 0; i < shown.size(); ++i) {
    if (cell_[i] < 0) continue;
    float& nearest = nearest_[cell_[i]];
    nearest = std::min(nearest, depth_[i]);
  }
  const float margin = occlusionMargin(image.K);
  for (int i = 0; i < shown.size(); ++i) {
    if (cell_[i] >= 0 && depth_[i] > margin * nearest_[cell_[i]]) hidden_.push_back(shown.cell[i]);
  }
  return hidden_;
}

}  // namespace nerf_pose_refiner
