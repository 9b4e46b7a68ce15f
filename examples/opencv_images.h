// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <nerf_pose_refiner/image.h>
#include <nerf_pose_refiner/observation.h>

#include <memory>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

/// The image of OpenCV that a camera took, 8-bit BGR, for a refiner or a tracker. It must not be
/// written to meanwhile. @throws std::runtime_error if it is empty.
inline nerf_pose_refiner::Observation observe(const cv::Mat& bgr,
                                              nerf_pose_refiner::Camera camera) {
  if (bgr.empty()) throw std::runtime_error("there is no image");
  camera.width = bgr.cols;
  camera.height = bgr.rows;
  const auto kept = std::make_shared<const cv::Mat>(bgr);  // shares the pixels
  return nerf_pose_refiner::observe({kept->data, kept->cols, kept->rows, 3, kept->step[0]},
                                    nerf_pose_refiner::PixelFormat::kBgr, camera, kept);
}

/// An image of OpenCV: 8-bit BGR of RGB.
inline cv::Mat bgrImage(nerf_pose_refiner::Image8 rgb) {
  cv::Mat bgr;
  cv::cvtColor(cv::Mat(rgb.height, rgb.width, CV_8UC3, rgb.values.data()), bgr, cv::COLOR_RGB2BGR);
  return bgr;
}
