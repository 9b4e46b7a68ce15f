// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/turned_view.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <memory>
#include <opencv2/imgproc.hpp>

#include "image/colour.h"

namespace nerf_pose_refiner {

Image turned(const Image& image, const Camera& from, const Eigen::Matrix3d& R, const Camera& to) {
  const Eigen::Vector2d outside(-2, -2);
  cv::Mat x(to.height, to.width, CV_32F), y(to.height, to.width, CV_32F);
  for (int v = 0; v < to.height; ++v) {
    for (int u = 0; u < to.width; ++u) {
      const Eigen::Vector3d seen = R.transpose() * to.direction(u, v);
      const Eigen::Vector2d pixel = seen.z() > 0 ? from.project(seen) : outside;
      x.at<float>(v, u) = static_cast<float>(pixel.x());
      y.at<float>(v, u) = static_cast<float>(pixel.y());
    }
  }
  const cv::Mat source(image.height, image.width, CV_32FC(image.channels),
                       const_cast<float*>(image.values.data()));
  Image result(to.width, to.height, image.channels);
  cv::Mat target(to.height, to.width, CV_32FC(image.channels), result.values.data());
  cv::remap(source, target, x, y, cv::INTER_LINEAR, cv::BORDER_CONSTANT);
  return result;
}

PosedView turned(const PosedView& view, double angle_rad) {
  const Camera& from = view.camera;
  const double right = std::max(from.cx, from.width - 1 - from.cx);
  const double below = std::max(from.cy, from.height - 1 - from.cy);
  const int radius = static_cast<int>(
      std::ceil(std::hypot(right / from.fx, below / from.fy) * std::max(from.fx, from.fy)));
  const double focal = std::max(from.fx, from.fy), middle = radius;
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  PosedView result = view;
  result.camera = {2 * radius + 1, 2 * radius + 1, focal, focal, middle, middle};
  result.photo_camera = result.camera;
  result.distortion = {};
  result.T_O_C = Pose(view.T_O_C.R * R.transpose(), view.T_O_C.t);
  const PremultipliedImage object = premultiply(*view.rgba);
  PremultipliedImage image;
  image.colour = turned(object.colour, from, R, result.camera);
  image.alpha = turned(object.alpha, from, R, result.camera);
  result.rgba = std::make_shared<const Image8>(straightBytes(image));
  return result;
}

}  // namespace nerf_pose_refiner
