// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/camera.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

void requirePositive(const char* name, double value) {
  if (!(std::isfinite(value) && value > 0)) {
    throw std::invalid_argument(std::string("Camera::") + name + " is " + std::to_string(value) +
                                ", must be positive");
  }
}

void requireFinite(const char* name, double value) {
  if (!std::isfinite(value)) {
    throw std::invalid_argument(std::string("Camera::") + name + " is not finite");
  }
}

}  // namespace

void Camera::validate() const {
  requirePositive("width", width);
  requirePositive("height", height);
  requirePositive("fx", fx);
  requirePositive("fy", fy);
  requireFinite("cx", cx);
  requireFinite("cy", cy);
}

Camera Camera::scaled(double s) const {
  return resized(std::max(1, static_cast<int>(std::lround(s * width))),
                 std::max(1, static_cast<int>(std::lround(s * height))));
}

Camera Camera::resized(int new_width, int new_height) const {
  const double sx = static_cast<double>(new_width) / width;
  const double sy = static_cast<double>(new_height) / height;
  return {new_width, new_height, sx * fx, sy * fy, (cx + 0.5) * sx - 0.5, (cy + 0.5) * sy - 0.5};
}

Camera Camera::cropped(int x, int y, int new_width, int new_height) const {
  return {new_width, new_height, fx, fy, cx - x, cy - y};
}

bool operator==(const Camera& a, const Camera& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
         a.cx == b.cx && a.cy == b.cy;
}

bool Distortion::isZero() const {
  return model == Model::kPolynomial &&
         std::all_of(coefficients.begin(), coefficients.end(), [](double k) { return k == 0; });
}

bool operator==(const Distortion& a, const Distortion& b) {
  return a.model == b.model && a.coefficients == b.coefficients;
}

}  // namespace nerf_pose_refiner
