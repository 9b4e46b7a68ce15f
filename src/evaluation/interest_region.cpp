// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <opencv2/imgproc.hpp>
#include <vector>

#include "evaluation/trial.h"
#include "image/colour.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kMaxCorners = 1000;
constexpr double kQuality = 0.01, kMinDistance = 3;  // of the best corner's; [px]
constexpr int kDilations = 3, kDilationSize = 5;     // of their code: 13 px across

}  // namespace

Image interestRegion(const Image& image) {
  Image8 bytes = toBytes(image);
  const cv::Mat rgb(bytes.height, bytes.width, CV_8UC3, bytes.values.data());
  cv::Mat grey;
  cv::cvtColor(rgb, grey, cv::COLOR_RGB2GRAY);
  std::vector<cv::Point2f> corners;
  cv::goodFeaturesToTrack(grey, corners, kMaxCorners, kQuality, kMinDistance);
  Image region(image.width, image.height, 1, corners.empty() ? 1.0f : 0.0f);
  for (const cv::Point2f& corner : corners) {
    region.at(static_cast<int>(corner.x), static_cast<int>(corner.y), 0) = 1;
  }
  cv::Mat mat(region.height, region.width, CV_32FC1, region.values.data());
  cv::dilate(mat, mat, cv::Mat::ones(kDilationSize, kDilationSize, CV_8U), cv::Point(-1, -1),
             kDilations);
  return region;
}

}  // namespace nerf_pose_refiner
