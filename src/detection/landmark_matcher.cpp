// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/landmark_matcher.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/flann.hpp>
#include <stdexcept>

#include "concurrency/parallel.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kTrees = 4;
constexpr std::uint64_t kTreeSeed = 1;  // the same landmarks make the same trees

cv::Mat view(const Descriptors& rows) {
  return {static_cast<int>(rows.rows()), static_cast<int>(rows.cols()), CV_32F,
          const_cast<float*>(rows.data())};
}

/// Between a place and the nearest one that looks like another place.
double apart(const Eigen::Vector3d& a, const Eigen::Vector3d& b, const Symmetries& symmetries) {
  double least = std::numeric_limits<double>::infinity();
  for (const Pose& motion : symmetries.motions()) {
    const Eigen::Vector3d moved = motion * a;
    double distance = (moved - b).norm();
    if (const auto& axis = symmetries.axis()) {  // of the two circles about it
      const auto split = [&](const Eigen::Vector3d& p) -> Eigen::Vector2d {
        const double height = (p - axis->point).dot(axis->direction);
        return {height, (p - axis->point - height * axis->direction).norm()};
      };
      distance = (split(moved) - split(b)).norm();
    }
    least = std::min(least, distance);
  }
  return least;
}

}  // namespace

struct LandmarkMatcher::Trees {
  explicit Trees(const Descriptors& rows) {
    const std::uint64_t state = cv::theRNG().state;
    cv::theRNG().state = kTreeSeed;
    index.build(view(rows), cv::flann::KDTreeIndexParams(kTrees));
    cv::theRNG().state = state;
  }

  mutable cv::flann::Index index;
};

LandmarkMatcher::LandmarkMatcher(const Landmarks& landmarks, double diameter,
                                 const MatchingSettings& settings, const Symmetries& symmetries)
    : landmarks_(&landmarks),
      other_place_(settings.other_place * diameter),
      symmetries_(symmetries),
      settings_(settings) {
  if (landmarks.size() > 0) trees_ = std::make_unique<Trees>(landmarks.descriptors);
}

LandmarkMatcher::~LandmarkMatcher() = default;
LandmarkMatcher::LandmarkMatcher(LandmarkMatcher&&) noexcept = default;

std::vector<FeatureMatch> LandmarkMatcher::match(const ImageFeatures& features) const {
  if (features.size() == 0 || !trees_) return {};
  if (features.descriptors.cols() != landmarks_->descriptors.cols()) {
    throw std::invalid_argument("the features are of another kind than the landmarks");
  }
  const int count = std::min(settings_.neighbours, landmarks_->size());
  std::vector<std::vector<FeatureMatch>> found(features.places.size());
  const auto matchOne = [&](int i) {
    const cv::Mat query = view(features.descriptors).row(i);
    cv::Mat numbers(1, count, CV_32S), squares(1, count, CV_32F);
    trees_->index.knnSearch(query, numbers, squares, count,
                            cv::flann::SearchParams(settings_.checks));
    const auto placeOf = [&](int rank) -> Eigen::Vector3d {
      const auto number = static_cast<std::size_t>(numbers.at<int>(rank));
      return landmarks_->places[number].point.cast<double>();
    };
    if (numbers.at<int>(0) < 0) return;
    int other = 1;
    while (other < count && numbers.at<int>(other) >= 0 &&
           apart(placeOf(other), placeOf(0), symmetries_) <= other_place_) {
      ++other;
    }
    const float ratio =
        other < count ? std::sqrt(squares.at<float>(0) / std::max(squares.at<float>(other), 1e-12f))
                      : 0;
    for (int rank = 0; rank < count && numbers.at<int>(rank) >= 0; ++rank) {
      found[static_cast<std::size_t>(i)].push_back({i, numbers.at<int>(rank), ratio, rank});
    }
  };
  parallelFor(threadCount(settings_.threads), features.size(), matchOne);
  std::vector<FeatureMatch> matches;
  for (const auto& of_feature : found) {
    matches.insert(matches.end(), of_feature.begin(), of_feature.end());
  }
  return matches;
}

}  // namespace nerf_pose_refiner
