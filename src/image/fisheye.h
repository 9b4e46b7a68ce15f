// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <vector>

#include "nerf_pose_refiner/camera.h"

namespace nerf_pose_refiner {

/// A fisheye lens after Kannala and Brandt, as cv::fisheye has it: a ray that is theta off the
/// optical axis meets the image at r(theta) = theta (1 + k1 theta^2 + k2 theta^4 + k3 theta^6 +
/// k4 theta^8) focal lengths from the principal point.
class FisheyeLens {
 public:
  /// @param camera focal lengths and principal point in the lens's own images.
  /// @param coefficients k1 to k4, or none for zeros.
  /// @throws std::invalid_argument for another number, or one that is not finite.
  FisheyeLens(const Camera& camera, const std::vector<double>& coefficients);

  double radius(double theta) const;  ///< r(theta) [focal lengths]

  /// Pixel of the direction (x, y, 1) in C.
  std::array<double, 2> project(double x, double y) const;

  /// The widest pinhole camera of the same size and principal point whose image the lens's fills,
  /// and that shows 70 degrees off the axis at most.
  /// @throws std::invalid_argument if the lens folds its image over itself, or its principal point
  /// is not in it.
  Camera widestPinhole() const;

 private:
  double largestAngle() const;
  bool fills(const Camera& pinhole) const;

  Camera camera_;
  std::array<double, 4> k_{};
};

}  // namespace nerf_pose_refiner
