// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/sharpness.h"

#include <opencv2/imgproc.hpp>

namespace nerf_pose_refiner {

double sharpness(const Image8& image) {
  if (image.empty()) return 0;
  const cv::Mat pixels(image.height, image.width, CV_8UC(image.channels),
                       const_cast<std::uint8_t*>(image.values.data()));  // is only read
  cv::Mat grey = pixels, laplacian;
  if (image.channels == 3) cv::cvtColor(pixels, grey, cv::COLOR_RGB2GRAY);
  if (image.channels == 4) cv::cvtColor(pixels, grey, cv::COLOR_RGBA2GRAY);
  cv::Laplacian(grey, laplacian, CV_64F);
  cv::Scalar mean, deviation;
  cv::meanStdDev(laplacian, mean, deviation);
  return deviation[0] * deviation[0];
}

}  // namespace nerf_pose_refiner
