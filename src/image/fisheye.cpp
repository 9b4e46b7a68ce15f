// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/fisheye.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {
namespace {

constexpr double kMaxAngle = 70 * 0.017453292519943295769;  // off the axis [rad]
constexpr int kAngleSteps = 700;                            // to find where a lens folds
constexpr int kBisections = 40;
constexpr double kMaxFocalFactor = 1024;

}  // namespace

FisheyeLens::FisheyeLens(const Camera& camera, const std::vector<double>& coefficients)
    : camera_(camera) {
  if (!coefficients.empty() && coefficients.size() != k_.size()) {
    throw std::invalid_argument("Distortion has " + std::to_string(coefficients.size()) +
                                " coefficients, a fisheye lens must have none or 4");
  }
  for (const double k : coefficients) {
    if (!std::isfinite(k)) {
      throw std::invalid_argument("Distortion holds a value that is not finite");
    }
  }
  std::copy(coefficients.begin(), coefficients.end(), k_.begin());
}

double FisheyeLens::radius(double theta) const {
  const double t2 = theta * theta;
  return theta * (1 + t2 * (k_[0] + t2 * (k_[1] + t2 * (k_[2] + t2 * k_[3]))));
}

std::array<double, 2> FisheyeLens::project(double x, double y) const {
  const double tangent = std::hypot(x, y);
  const double factor = tangent > 0 ? radius(std::atan(tangent)) / tangent : 1.0;
  return {camera_.fx * factor * x + camera_.cx, camera_.fy * factor * y + camera_.cy};
}

/// Up to which r(theta) grows: beyond it two directions would share a pixel.
double FisheyeLens::largestAngle() const {
  for (int i = 1; i <= kAngleSteps; ++i) {
    const double before = kMaxAngle * (i - 1) / kAngleSteps;
    if (radius(kMaxAngle * i / kAngleSteps) <= radius(before)) return before;
  }
  return kMaxAngle;
}

/// Whether the rim of a pinhole image, and so all of it, lies inside of the lens's image.
bool FisheyeLens::fills(const Camera& pinhole) const {
  const auto inside = [&](int u, int v) {
    const auto pixel = project((u - pinhole.cx) / pinhole.fx, (v - pinhole.cy) / pinhole.fy);
    return pixel[0] >= 0 && pixel[0] <= camera_.width - 1 && pixel[1] >= 0 &&
           pixel[1] <= camera_.height - 1;
  };
  for (int u = 0; u < pinhole.width; ++u) {
    if (!inside(u, 0) || !inside(u, pinhole.height - 1)) return false;
  }
  for (int v = 0; v < pinhole.height; ++v) {
    if (!inside(0, v) || !inside(pinhole.width - 1, v)) return false;
  }
  return true;
}

Camera FisheyeLens::widestPinhole() const {
  const double left = camera_.cx / camera_.fx, right = (camera_.width - 1) / camera_.fx - left;
  const double top = camera_.cy / camera_.fy, bottom = (camera_.height - 1) / camera_.fy - top;
  const double nearest_rim = std::min({left, right, top, bottom});
  const double farthest_corner = std::hypot(std::max(left, right), std::max(top, bottom));
  if (!(nearest_rim > 0)) {
    throw std::invalid_argument("the principal point of the fisheye camera is not in its image");
  }
  const double angle = largestAngle();
  if (angle < kMaxAngle && radius(angle) < nearest_rim) {
    throw std::invalid_argument(
        "the lens distortion folds the image over itself: its coefficients cannot belong to a "
        "camera of this size and focal length");
  }
  const auto pinholeOf = [this](double focal_factor) {
    Camera pinhole = camera_;
    pinhole.fx *= focal_factor;
    pinhole.fy *= focal_factor;
    return pinhole;
  };
  double wide = farthest_corner / std::tan(angle);
  if (fills(pinholeOf(wide))) return pinholeOf(wide);
  double narrow = std::max(wide, 1.0);
  while (!fills(pinholeOf(narrow)) && narrow < kMaxFocalFactor) narrow *= 2;
  for (int i = 0; i < kBisections; ++i) {
    const double middle = 0.5 * (wide + narrow);
    (fills(pinholeOf(middle)) ? narrow : wide) = middle;
  }
  return pinholeOf(narrow);
}

}  // namespace nerf_pose_refiner
