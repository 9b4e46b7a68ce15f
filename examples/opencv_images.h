// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/image.h>

#include <opencv2/imgproc.hpp>
#include <stdexcept>

/// The library's image of one of OpenCV's: RGB of 8-bit BGR. @throws std::runtime_error if empty.
inline nerf_pose_refiner::Image8 rgbImage(const cv::Mat& bgr) {
  if (bgr.empty()) throw std::runtime_error("there is no image");
  nerf_pose_refiner::Image8 rgb(bgr.cols, bgr.rows, 3);
  cv::Mat wrapped(bgr.rows, bgr.cols, CV_8UC3, rgb.values.data());
  cv::cvtColor(bgr, wrapped, cv::COLOR_BGR2RGB);
  return rgb;
}

/// The inverse.
inline cv::Mat bgrImage(nerf_pose_refiner::Image8 rgb) {
  cv::Mat bgr;
  cv::cvtColor(cv::Mat(rgb.height, rgb.width, CV_8UC3, rgb.values.data()), bgr, cv::COLOR_RGB2BGR);
  return bgr;
}
