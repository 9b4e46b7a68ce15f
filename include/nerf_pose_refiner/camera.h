// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

namespace nerf_pose_refiner {

/// A pinhole camera in the ROS optical frame C: x right, y down, z forward (REP-103).
///
/// Pixel centres are integers (OpenCV, ROS): the image covers [-0.5, width - 0.5] in x. There is no
/// lens distortion: images are undistorted once, on arrival (undistorter.h).
struct Camera {
  int width = 0;   ///< [px]
  int height = 0;  ///< [px]
  double fx = 0;   ///< focal lengths [px]
  double fy = 0;
  double cx = 0;  ///< principal point [px], integer pixel centres
  double cy = 0;

  /// @throws std::invalid_argument naming a value that is not positive or not finite.
  void validate() const;

  /// The camera of the image resized by `s` in both directions: f' = s f, c' = (c + 0.5) s - 0.5,
  /// with the size rounded. The principal point uses the exact factor of each axis.
  Camera scaled(double s) const;

  /// The camera of the image resized to exactly width x height.
  Camera resized(int new_width, int new_height) const;

  /// The camera of the part whose first pixel is (x, y); it may extend beyond the image.
  Camera cropped(int x, int y, int new_width, int new_height) const;

  /// Direction of the ray through pixel (u, v) in C, not normalised (z = 1).
  Eigen::Vector3d direction(double u, double v) const {
    return {(u - cx) / fx, (v - cy) / fy, 1.0};
  }

  /// Pixel of a point in C. Requires p_C.z() > 0.
  Eigen::Vector2d project(const Eigen::Vector3d& p_C) const {
    return {fx * p_C.x() / p_C.z() + cx, fy * p_C.y() / p_C.z() + cy};
  }
};

bool operator==(const Camera& a, const Camera& b);

/// Lens distortion, as OpenCV defines it.
struct Distortion {
  /// OpenCV's models, which give the coefficients their order.
  enum class Model {
    kPolynomial,  ///< k1 k2 p1 p2 [k3 [k4 k5 k6]]: 4, 5 (plumb_bob) or 8 (rational_polynomial)
    kFisheye      ///< k1 k2 k3 k4 of cv::fisheye (ROS: equidistant): 4, or none for all zero
  };
  std::vector<double> coefficients;
  Model model = Model::kPolynomial;

  /// Whether images are those of a pinhole camera. (Those of a fisheye lens are not, even if all
  /// coefficients are zero.)
  bool isZero() const;
};

bool operator==(const Distortion& a, const Distortion& b);

}  // namespace nerf_pose_refiner
