// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/image_features.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/features2d.hpp>
#include <stdexcept>

#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

#if CV_VERSION_MAJOR > 4 || (CV_VERSION_MAJOR == 4 && CV_VERSION_MINOR >= 4)
constexpr bool kHasSift = true;
cv::Ptr<cv::Feature2D> makeSift(const FeatureSettings& settings) {
  constexpr int kLayers = 3;  // of an octave
  return cv::SIFT::create(0, kLayers, settings.contrast);
}
#else
constexpr bool kHasSift = false;
cv::Ptr<cv::Feature2D> makeSift(const FeatureSettings&) {
  throw std::invalid_argument("SIFT features need OpenCV 4.4 or later");
}
#endif

cv::Ptr<cv::Feature2D> makeDetector(const FeatureSettings& settings) {
  if (settings.kind == FeatureKind::kSift) return makeSift(settings);
  if (settings.kind != FeatureKind::kAkaze) {
    throw std::invalid_argument("no such kind of features");
  }
  constexpr float kThreshold = 3e-4f;
  return cv::AKAZE::create(cv::AKAZE::DESCRIPTOR_KAZE, 0, 3, kThreshold);
}

cv::Mat view(const Image8& image) {
  return {image.height, image.width, CV_8UC1, const_cast<std::uint8_t*>(image.values.data())};
}

// Length 1; of SIFT the square roots, so that distances are those of Hellinger's kernel.
void normalise(FeatureKind kind, Descriptors* descriptors) {
  for (Eigen::Index i = 0; i < descriptors->rows(); ++i) {
    auto row = descriptors->row(i);
    if (kind == FeatureKind::kSift) row = row.cwiseMax(0).cwiseSqrt().eval();
    const float length = row.norm();
    if (length > 0) row /= length;
  }
}

std::vector<int> strongestOf(const std::vector<cv::KeyPoint>& keypoints, int most) {
  std::vector<int> order(keypoints.size());
  std::iota(order.begin(), order.end(), 0);
  const auto response = [&](int i) { return keypoints[static_cast<std::size_t>(i)].response; };
  std::stable_sort(order.begin(), order.end(),
                   [&](int a, int b) { return response(a) > response(b); });
  if (order.size() > static_cast<std::size_t>(most)) order.resize(static_cast<std::size_t>(most));
  return order;
}

}  // namespace

FeatureKind bestFeatureKind() { return kHasSift ? FeatureKind::kSift : FeatureKind::kAkaze; }

ImageFeatures findFeatures(const Image8& grey, const Image8& where,
                           const FeatureSettings& settings) {
  if (grey.empty() || grey.channels != 1) {
    throw std::invalid_argument("features: the image must have one channel");
  }
  if (!where.empty() &&
      (where.channels != 1 || where.width != grey.width || where.height != grey.height)) {
    throw std::invalid_argument("features: the mask is not of the image's size");
  }
  const cv::Ptr<cv::Feature2D> detector = makeDetector(settings);
  const cv::Mat mask = where.empty() ? cv::Mat() : view(where);
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat rows;
  detector->detectAndCompute(view(grey), mask, keypoints, rows);

  const std::vector<int> strongest = strongestOf(keypoints, settings.max_features);
  ImageFeatures features;
  features.descriptors.resize(static_cast<Eigen::Index>(strongest.size()), rows.cols);
  for (const int i : strongest) {
    const cv::KeyPoint& point = keypoints[static_cast<std::size_t>(i)];
    std::copy_n(rows.ptr<float>(i), rows.cols, features.descriptors.row(features.size()).data());
    const auto angle_rad = static_cast<float>(kDegree) * point.angle;
    features.places.push_back({point.pt.x, point.pt.y, point.size, angle_rad});
  }
  normalise(settings.kind, &features.descriptors);
  return features;
}

Image8 luminance(const Image& colour) {
  if (colour.channels != 3) throw std::invalid_argument("luminance: the image must have colours");
  Image8 grey(colour.width, colour.height, 1);
  for (std::size_t i = 0; i < grey.pixels(); ++i) {
    const float* p = colour.values.data() + 3 * i;
    const float value = 0.299f * p[0] + 0.587f * p[1] + 0.114f * p[2];
    grey.values[i] =
        static_cast<std::uint8_t>(std::lround(255 * std::min(1.0f, std::max(0.0f, value))));
  }
  return grey;
}

}  // namespace nerf_pose_refiner
