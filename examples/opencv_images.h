// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/image.h>
#include <nerf_pose_refiner/observation.h>

#include <memory>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

/// The image of OpenCV that a camera took, 8-bit grey, BGR or BGRA, for a refiner, a tracker or a
/// detector. The observation refers to its pixels: what overwrites them, such as the next
/// `video.read(bgr)`, changes it.
/// @param camera its width and height are checked against the image's, unless they are 0.
/// @throws std::runtime_error for an image of another kind, or none.
inline nerf_pose_refiner::Observation observeMat(const cv::Mat& bgr,
                                                 nerf_pose_refiner::Camera camera) {
  using nerf_pose_refiner::PixelFormat;
  const int channels = bgr.channels();
  if (bgr.empty()) throw std::runtime_error("there is no image");
  if (bgr.depth() != CV_8U || channels == 2 || channels > 4) {
    throw std::runtime_error("the image is not 8-bit grey, BGR or BGRA");
  }
  const PixelFormat format = channels == 1   ? PixelFormat::kGrey
                             : channels == 3 ? PixelFormat::kBgr
                                             : PixelFormat::kBgra;
  if (camera.width == 0 && camera.height == 0) {
    camera.width = bgr.cols;
    camera.height = bgr.rows;
  }
  const auto kept = std::make_shared<const cv::Mat>(bgr);  // shares the pixels
  return nerf_pose_refiner::observe({kept->data, kept->cols, kept->rows, channels, kept->step[0]},
                                    format, camera, kept);
}

/// An image of OpenCV: 8-bit BGR of RGB.
inline cv::Mat bgrImage(nerf_pose_refiner::Image8 rgb) {
  cv::Mat bgr;
  cv::cvtColor(cv::Mat(rgb.height, rgb.width, CV_8UC3, rgb.values.data()), bgr, cv::COLOR_RGB2BGR);
  return bgr;
}
