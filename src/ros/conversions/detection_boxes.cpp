// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "ros/conversions/detection_boxes.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "detection/search_area.h"

namespace nerf_pose_refiner {
namespace {

/// How sure the detector is that a box shows the class; nothing: the box is of another.
std::optional<double> scoreOf(const DetectionArray::Box& box, std::int64_t class_id) {
  std::optional<double> best;
  for (const DetectionArray::Class& one : box.classes) {
    if (class_id != -1 && one.id != class_id) continue;
    if (std::isfinite(one.score)) best = std::max(best.value_or(one.score), one.score);
  }
  return best;
}

/// The upright box around a box.
ImageBox uprightBox(const DetectionArray::Box& box) {
  const double c = std::abs(std::cos(box.angle_rad)), s = std::abs(std::sin(box.angle_rad));
  const double half_width = 0.5 * (c * box.width + s * box.height);
  const double half_height = 0.5 * (s * box.width + c * box.height);
  return {box.centre_x - half_width, box.centre_y - half_height, box.centre_x + half_width,
          box.centre_y + half_height};
}

bool makesSense(const ImageBox& box) {
  constexpr double kFarthest_px = 1e6;
  const auto is_near = [](double x) { return std::abs(x) <= kFarthest_px; };  // no NaN is
  return is_near(box.x_min) && is_near(box.y_min) && is_near(box.x_max) && is_near(box.y_max) &&
         box.x_min < box.x_max && box.y_min < box.y_max;
}

}  // namespace

StampedBoxes boxesOf(const DetectionArray& detections, std::int64_t class_id) {
  std::vector<std::pair<double, ImageBox>> scored;
  for (const DetectionArray::Box& box : detections.boxes) {
    const std::optional<double> score = scoreOf(box, class_id);
    const ImageBox upright = uprightBox(box);
    if (score && makesSense(upright)) scored.emplace_back(*score, upright);
  }
  std::stable_sort(scored.begin(), scored.end(),
                   [](const auto& a, const auto& b) { return a.first > b.first; });
  StampedBoxes result;
  result.header = detections.header;
  for (const auto& [score, box] : scored) {
    if (result.boxes.size() < SearchArea::kMaxBoxes) result.boxes.push_back(box);
  }
  return result;
}

}  // namespace nerf_pose_refiner
