// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/search_area.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "backend/common/observed_colours.h"
#include "image/resample.h"
#include "refinement/grey_image.h"

namespace nerf_pose_refiner {

void SearchArea::validate() const {
  if (box && !(box->min().allFinite() && box->max().allFinite() && !box->isEmpty())) {
    throw std::invalid_argument("the box makes no sense");
  }
  if (distance && !(std::isfinite(*distance) && *distance > 0)) {
    throw std::invalid_argument("the distance of the object is " + std::to_string(*distance));
  }
  if (!(std::isfinite(distance_ratio) && distance_ratio > 1)) {
    throw std::invalid_argument("the ratio of distances is " + std::to_string(distance_ratio));
  }
  if (!(std::isfinite(odds) && odds > 0)) {
    throw std::invalid_argument("the odds of the area are " + std::to_string(odds));
  }
}

double oddsIn(const SearchArea& area, const Observation& observation) {
  // Of a thousand images without the object two had a pose, both grey; right ones are nearly all
  // likely enough to bear this.
  constexpr double kGreyOdds = 0.1;
  const bool is_told = area.box || area.odds > 1 || observation.background == Background::kMask;
  return !is_told && isGrey(observation).value_or(false) ? kGreyOdds * area.odds : area.odds;
}

std::vector<SearchArea> areasOf(const Observation& observation, const SearchArea& area) {
  if (area.box || observation.boxes.empty()) return {area};
  std::vector<SearchArea> areas;
  for (const ImageBox& box : observation.boxes) {
    if (areas.size() == SearchArea::kMaxBoxes) break;
    areas.push_back(area);
    areas.back().box = Eigen::AlignedBox2d(Eigen::Vector2d(box.x_min, box.y_min),
                                           Eigen::Vector2d(box.x_max, box.y_max));
  }
  return areas;
}

std::optional<SearchedPart> searchedPart(const Camera& camera, const SearchArea& area,
                                         int max_side_px) {
  constexpr int kMinSide_px = 32;
  int left = 0, top = 0, right = camera.width, bottom = camera.height;
  if (area.box) {
    constexpr double kMargin = 0.1;  // boxes of detectors are tight, and descriptors look around
    const Eigen::Vector2d size = area.box->sizes();
    const Eigen::Vector2d margin =
        (kMargin * size).cwiseMax(0.5 * (Eigen::Vector2d::Constant(kMinSide_px) - size));
    const Eigen::Vector2d first = area.box->min() - margin, last = area.box->max() + margin;
    left = static_cast<int>(std::max<double>(left, std::floor(first.x() + 0.5)));
    top = static_cast<int>(std::max<double>(top, std::floor(first.y() + 0.5)));
    right = static_cast<int>(std::min<double>(right, std::ceil(last.x() + 0.5)));
    bottom = static_cast<int>(std::min<double>(bottom, std::ceil(last.y() + 0.5)));
  }
  const int width = right - left, height = bottom - top;
  if (std::min(width, height) < kMinSide_px) return std::nullopt;
  const Camera part = camera.cropped(left, top, width, height);
  const double scale = std::min(1.0, static_cast<double>(max_side_px) / std::max(width, height));
  return SearchedPart{{left, top, width, height}, scale < 1 ? part.scaled(scale) : part};
}

Image coloursOf(const Observation& observation, const SearchedPart& part) {
  const PixelWindow& window = part.window;
  Image colours = observedColours(observation, window);
  if (part.camera.width == window.width && part.camera.height == window.height) return colours;
  const Camera camera = observation.camera.cropped(window.x, window.y, window.width, window.height);
  return resample(colours, camera, part.camera);
}

Image8 allowedPixels(const Observation& observation, const Camera& part) {
  const bool has_alpha = observation.background == Background::kMask ||
                         observation.background == Background::kKnownAlpha;
  if (!has_alpha && observation.weight.empty()) return {};
  Image8 allowed(part.width, part.height, 1, 255);
  for (const Image* image : {has_alpha ? &observation.alpha : nullptr,
                             observation.weight.empty() ? nullptr : &observation.weight}) {
    if (image == nullptr) continue;
    const Image values = resample(*image, observation.camera, part);
    for (std::size_t i = 0; i < values.values.size(); ++i) {
      if (values.values[i] < 0.5f) allowed.values[i] = 0;
    }
  }
  return allowed;
}

bool isAnyAllowed(const Image8& allowed, const Eigen::Vector2d& middle, double radius_px) {
  if (allowed.empty()) return true;
  const auto clamped = [](double value, int size) {
    return static_cast<int>(std::clamp<double>(std::lround(value), 0, size));
  };
  const int right = clamped(middle.x() + radius_px + 1, allowed.width);
  const int bottom = clamped(middle.y() + radius_px + 1, allowed.height);
  for (int y = clamped(middle.y() - radius_px, allowed.height); y < bottom; ++y) {
    for (int x = clamped(middle.x() - radius_px, allowed.width); x < right; ++x) {
      if (allowed.at(x, y, 0) > 0) return true;
    }
  }
  return false;
}

bool isAtDistance(const SearchArea& area, double distance) {
  return !area.distance || (distance < area.distance_ratio * *area.distance &&
                            area.distance_ratio * distance > *area.distance);
}

}  // namespace nerf_pose_refiner
