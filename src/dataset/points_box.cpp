// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/points_box.h"

#include <algorithm>
#include <vector>

namespace nerf_pose_refiner {
namespace {

constexpr std::uint32_t kMinPhotos = 3;  // two rays nearly always meet somewhere
constexpr double kMaxErrorPx = 2;
constexpr double kOutliers = 0.01;  // fraction of points that is cut off at each side
constexpr double kMargin = 0.05;    // of the size, added at each side

bool isReliable(const ScenePoint& point) {
  return point.photos >= kMinPhotos && point.error_px <= kMaxErrorPx;
}

}  // namespace

void useBoxOfPoints(Dataset* dataset) {
  const std::vector<ScenePoint>& points = dataset->points;
  const bool any_reliable = std::any_of(points.begin(), points.end(), isReliable);
  for (int axis = 0; axis < 3; ++axis) {
    std::vector<double> x;
    for (const ScenePoint& point : points) {
      if (!any_reliable || isReliable(point)) x.push_back(point.position_O[axis]);
    }
    const auto cut = static_cast<std::ptrdiff_t>(kOutliers * static_cast<double>(x.size()));
    std::nth_element(x.begin(), x.begin() + cut, x.end());
    const double low = x[static_cast<std::size_t>(cut)];
    std::nth_element(x.begin(), x.end() - 1 - cut, x.end());
    const double high = *(x.end() - 1 - cut);
    dataset->box_min[axis] = low - kMargin * (high - low);
    dataset->box_max[axis] = high + kMargin * (high - low);
  }
  if (!(dataset->box_min.array() < dataset->box_max.array()).all()) return;  // points in a plane
  dataset->has_box = true;
  dataset->notes.push_back(
      "The photos have no alpha and no masks, and no box is given: the box of the scene's points "
      "is "
      "used, which holds what is around the object, too. A box around the object alone gives a "
      "better model.");
}

}  // namespace nerf_pose_refiner
