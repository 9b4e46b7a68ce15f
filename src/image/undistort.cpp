// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/undistorter.h"

#include <cmath>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>
#include <string>

#include "image/colour.h"
#include "image/fisheye.h"

namespace nerf_pose_refiner {
namespace {

cv::Matx33d matrixOf(const Camera& camera) {
  return {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1};
}

void check(const Distortion& distortion) {
  const std::size_t n = distortion.coefficients.size();
  if (n != 4 && n != 5 && n != 8) {
    throw std::invalid_argument("Distortion has " + std::to_string(n) +
                                " coefficients, must have none, 4, 5 or 8");
  }
  for (const double k : distortion.coefficients) {
    if (!std::isfinite(k))
      throw std::invalid_argument("Distortion holds a value that is not finite");
  }
}

void requireSize(int width, int height, const Camera& camera) {
  if (width == camera.width && height == camera.height) return;
  throw std::invalid_argument("undistort: the image has " + std::to_string(width) + " x " +
                              std::to_string(height) + " pixels, its camera " +
                              std::to_string(camera.width) + " x " + std::to_string(camera.height));
}

cv::Mat matrixOf(Image* image) {
  return cv::Mat(image->height, image->width, CV_32FC(image->channels), image->values.data());
}

/// Whether a camera can be one: what folds an image can leave a focal length below zero.
bool isPinhole(const Camera& camera) {
  const auto is_positive = [](double f) { return std::isfinite(f) && f > 0; };
  return is_positive(camera.fx) && is_positive(camera.fy) && std::isfinite(camera.cx) &&
         std::isfinite(camera.cy);
}

/// True if every pixel comes from inside of the distorted image, to `slack_px`.
bool staysInside(const cv::Mat& map_xy, const Camera& camera, double slack_px) {
  for (int y = 0; y < map_xy.rows; ++y) {
    const cv::Vec2f* row = map_xy.ptr<cv::Vec2f>(y);
    for (int x = 0; x < map_xy.cols; ++x) {
      const bool inside = row[x][0] > -slack_px && row[x][0] < camera.width - 1 + slack_px &&
                          row[x][1] > -slack_px && row[x][1] < camera.height - 1 + slack_px;
      if (!inside) return false;
    }
  }
  return true;
}

/// For each pixel of the undistorted image its place in the distorted one, CV_32FC2.
/// @param undistorted is set to the camera of the undistorted image.
cv::Mat polynomialMap(const Camera& camera, const Distortion& distortion, Camera* undistorted) {
  check(distortion);
  const cv::Size size(camera.width, camera.height);
  const cv::Matx33d K = matrixOf(camera);
  const cv::Mat new_K =
      cv::getOptimalNewCameraMatrix(K, distortion.coefficients, size, /*alpha=*/0, size);
  undistorted->fx = new_K.at<double>(0, 0);
  undistorted->fy = new_K.at<double>(1, 1);
  undistorted->cx = new_K.at<double>(0, 2);
  undistorted->cy = new_K.at<double>(1, 2);
  cv::Mat xy;
  cv::initUndistortRectifyMap(K, distortion.coefficients, cv::noArray(), new_K, size, CV_32FC2, xy,
                              cv::noArray());
  // The widest filled image is found on a coarse grid: it may be off by a little at its rim.
  const double slack_px = 1 + 0.01 * std::max(camera.width, camera.height);
  if (!isPinhole(*undistorted) || !staysInside(xy, camera, slack_px)) {
    throw std::invalid_argument(
        "the lens distortion folds the image over itself: its coefficients cannot belong to a "
        "camera of this size and focal length");
  }
  return xy;
}

cv::Mat fisheyeMap(const Camera& camera, const Distortion& distortion, Camera* undistorted) {
  const FisheyeLens lens(camera, distortion.coefficients);
  const Camera pinhole = lens.widestPinhole();
  cv::Mat xy(camera.height, camera.width, CV_32FC2);
  for (int y = 0; y < xy.rows; ++y) {
    cv::Vec2f* row = xy.ptr<cv::Vec2f>(y);
    for (int x = 0; x < xy.cols; ++x) {
      const auto pixel = lens.project((x - pinhole.cx) / pinhole.fx, (y - pinhole.cy) / pinhole.fy);
      row[x] = {static_cast<float>(pixel[0]), static_cast<float>(pixel[1])};
    }
  }
  *undistorted = pinhole;
  return xy;
}

}  // namespace

struct Undistorter::Maps {
  cv::Mat xy;        // [h][w] place in the distorted image, whole pixels
  cv::Mat fraction;  // [h][w] and the rest, in the steps that OpenCV interpolates in

  void remap(const cv::Mat& source, const PixelWindow& window, cv::Mat target) const {
    const cv::Rect part(window.x, window.y, window.width, window.height);
    cv::remap(source, target, xy(part), fraction(part), cv::INTER_LINEAR, cv::BORDER_REPLICATE);
  }
};

Undistorter::Undistorter(const Camera& camera, const Distortion& distortion)
    : undistorted_(camera) {
  camera.validate();
  if (distortion.isZero()) return;
  const bool fisheye = distortion.model == Distortion::Model::kFisheye;
  const cv::Mat xy = fisheye ? fisheyeMap(camera, distortion, &undistorted_)
                             : polynomialMap(camera, distortion, &undistorted_);
  // As cv::remap would do it for each image: the same pixels, sooner.
  maps_ = std::make_unique<Maps>();
  cv::convertMaps(xy, cv::noArray(), maps_->xy, maps_->fraction, CV_16SC2);
}

Undistorter::~Undistorter() = default;
Undistorter::Undistorter(Undistorter&&) noexcept = default;
Undistorter& Undistorter::operator=(Undistorter&&) noexcept = default;

Image8 Undistorter::undistort(const Image8& image) const {
  requireSize(image.width, image.height, undistorted_);
  if (!maps_) return image;
  const PixelWindow all = {0, 0, image.width, image.height};
  if (image.channels != 4) return undistort(viewOf(image), all);
  // Colour is interpolated premultiplied: what is transparent has no colour to mix in.
  PremultipliedImage parts = premultiply(image);
  PremultipliedImage result = parts;
  maps_->remap(matrixOf(&parts.colour), all, matrixOf(&result.colour));
  maps_->remap(matrixOf(&parts.alpha), all, matrixOf(&result.alpha));
  return straightBytes(result);
}

Image8 Undistorter::undistort(const Image8View& image, const PixelWindow& window) const {
  requireSize(image.width, image.height, undistorted_);
  if (window.empty() || (cv::Rect(window.x, window.y, window.width, window.height) &
                         cv::Rect(0, 0, image.width, image.height))
                                .area() != window.width * window.height) {
    throw std::invalid_argument("undistort: the window reaches outside of the image");
  }
  // OpenCV only reads from it.
  const cv::Mat source(image.height, image.width, CV_8UC(image.channels),
                       const_cast<std::uint8_t*>(image.data), image.row_bytes);
  Image8 result(window.width, window.height, image.channels);
  cv::Mat target(result.height, result.width, source.type(), result.values.data());
  if (maps_) {
    maps_->remap(source, window, target);
  } else {
    source(cv::Rect(window.x, window.y, window.width, window.height)).copyTo(target);
  }
  return result;
}

}  // namespace nerf_pose_refiner
