// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/aimed_view.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <memory>
#include <opencv2/imgproc.hpp>

#include "evaluation/placement.h"
#include "image/resample.h"

namespace nerf_pose_refiner {
namespace {

/// The smallest rotation that takes one direction to another one, less than 180 degrees away.
Eigen::Matrix3d rotationTo(const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  const Eigen::Vector3d cross = from.normalized().cross(to.normalized());
  const double sine = cross.norm();
  if (sine < 1e-12) return Eigen::Matrix3d::Identity();
  const double angle = std::atan2(sine, from.normalized().dot(to.normalized()));
  return Eigen::AngleAxisd(angle, cross / sine).toRotationMatrix();
}

/// What a camera sees that is turned by R about the centre of the image's: x_to = R x_from.
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

}  // namespace

AimedView aimedView(const PosedView& view, const Eigen::Matrix3d& R, const Camera& to) {
  const Camera reduced = view.camera.scaled(std::min(1.0, to.fx / view.camera.fx));
  const PremultipliedImage object = premultiply(*view.rgba);
  const auto seen = [&](const Image& image) {
    return turned(resample(image, view.camera, reduced), reduced, R, to);
  };
  return {{view.T_O_C.R * R.transpose(), view.T_O_C.t}, {seen(object.colour), seen(object.alpha)}};
}

Eigen::Matrix3d rotationToPlace(const PosedView& view, const Camera& to,
                                const Eigen::Vector2d& place, double roll_rad) {
  const Eigen::Vector2d middle = silhouetteBox(view).center();
  const Eigen::Vector3d towards = to.direction(place.x(), place.y()).normalized();
  return Eigen::AngleAxisd(roll_rad, towards).toRotationMatrix() *
         rotationTo(view.camera.direction(middle.x(), middle.y()), towards);
}

void putInFront(const PremultipliedImage& object, PremultipliedImage* image) {
  for (std::size_t i = 0; i < image->alpha.values.size(); ++i) {
    const float behind = 1 - object.alpha.values[i];
    image->alpha.values[i] = object.alpha.values[i] + behind * image->alpha.values[i];
    for (std::size_t c = 3 * i; c < 3 * i + 3; ++c) {
      image->colour.values[c] = object.colour.values[c] + behind * image->colour.values[c];
    }
  }
}

PosedView turned(const PosedView& view, double angle_rad) {
  const Camera& from = view.camera;
  const double right = std::max(from.cx, from.width - 1 - from.cx);
  const double below = std::max(from.cy, from.height - 1 - from.cy);
  const double focal = std::max(from.fx, from.fy);
  const int radius =
      static_cast<int>(std::ceil(focal * std::hypot(right / from.fx, below / from.fy)));
  const Eigen::Matrix3d R =
      Eigen::AngleAxisd(angle_rad, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  PosedView result = view;
  result.camera = {2 * radius + 1, 2 * radius + 1, focal, focal, 1.0 * radius, 1.0 * radius};
  result.photo_camera = result.camera;
  result.distortion = {};
  const AimedView seen = aimedView(view, R, result.camera);
  result.T_O_C = seen.T_O_C;
  result.rgba = std::make_shared<const Image8>(straightBytes(seen.object));
  return result;
}

}  // namespace nerf_pose_refiner
