// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/frame_part.h"

#include <algorithm>
#include <cmath>

namespace nerf_pose_refiner {
namespace {

// Along an axis: from `begin` to before `end`.
struct Range {
  int begin, end;
};

// The least range with whole steps that contains a range; the last step may be cut by the image.
Range wholeSteps(const Range& range, int size, int step) {
  const int begin = std::max(0, range.begin) / step * step;
  return {begin, std::min(size, (range.end + step - 1) / step * step)};
}

FramePart partOf(const Range& columns, const Range& rows, int finest, int coarsest,
                 const Camera& camera) {
  const int step = 1 << coarsest;
  const Range x = wholeSteps(columns, camera.width, step);
  const Range y = wholeSteps(rows, camera.height, step);
  return {{x.begin, y.begin, x.end - x.begin, y.end - y.begin}, finest, coarsest};
}

Range columnsOf(const PixelWindow& window) { return {window.x, window.x + window.width}; }

Range rowsOf(const PixelWindow& window) { return {window.y, window.y + window.height}; }

bool contains(const PixelWindow& outer, const PixelWindow& inner) {
  return inner.x >= outer.x && inner.y >= outer.y &&
         inner.x + inner.width <= outer.x + outer.width &&
         inner.y + inner.height <= outer.y + outer.height;
}

}  // namespace

bool FramePart::holds(const FrameLevels& levels) const {
  const FramePart needed = partFor(levels);
  return finest <= needed.finest && coarsest >= needed.coarsest && contains(window, needed.window);
}

PixelWindow FramePart::pixelsOf(const FrameLevels& levels, int level) const {
  const PixelWindow& own = levels.window();
  return {(own.x - window.x) >> level, (own.y - window.y) >> level, own.width >> level,
          own.height >> level};
}

FramePart partFor(const FrameLevels& levels) {
  const int coarsest = levels.finest() + levels.count() - 1;
  const FramePart own = {levels.window(), levels.finest(), coarsest};
  return widened(own, 1 << coarsest, levels.camera());
}

FramePart together(const FramePart& a, const FramePart& b, const Camera& camera) {
  const auto both = [](const Range& u, const Range& v) {
    return Range{std::min(u.begin, v.begin), std::max(u.end, v.end)};
  };
  return partOf(both(columnsOf(a.window), columnsOf(b.window)),
                both(rowsOf(a.window), rowsOf(b.window)), std::min(a.finest, b.finest),
                std::max(a.coarsest, b.coarsest), camera);
}

FramePart widened(const FramePart& part, int border, const Camera& camera) {
  const auto wider = [border](const Range& range) {
    return Range{range.begin - border, range.end + border};
  };
  return partOf(wider(columnsOf(part.window)), wider(rowsOf(part.window)), part.finest,
                part.coarsest, camera);
}

double shareWithin(const FramePart& part, const FramePart& other) {
  const auto common = [](const Range& a, const Range& b) {
    return std::max(0, std::min(a.end, b.end) - std::max(a.begin, b.begin));
  };
  const PixelWindow &own = part.window, &its = other.window;
  const double shared = static_cast<double>(common(columnsOf(own), columnsOf(its))) *
                        common(rowsOf(own), rowsOf(its));
  return shared / (static_cast<double>(own.width) * own.height);
}

double makingWork(const FramePart& part) {
  const double pixels = static_cast<double>(part.window.width) * part.window.height;
  return pixels * (1 + std::ldexp(1.0, -2 * part.finest));  // those of the finest level are blurred
}

}  // namespace nerf_pose_refiner
