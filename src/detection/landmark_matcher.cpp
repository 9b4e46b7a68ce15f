// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/landmark_matcher.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "field/field.h"
#include "math/require.h"

namespace nerf_pose_refiner {
namespace {

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

void MatchingSettings::validate() const {
  require(other_place > 0, "MatchingSettings::other_place", other_place);
  require(neighbours >= 1 && neighbours <= DescriptorIndex::kMostNeighbours,
          "MatchingSettings::neighbours", neighbours);
}

LandmarkMatcher::LandmarkMatcher(Backend* backend, const Landmarks& landmarks,
                                 const FieldMetadata& object, const MatchingSettings& settings)
    : landmarks_(&landmarks),
      other_place_(settings.other_place * object.diameter),
      symmetries_(object.symmetries),
      settings_(settings) {
  settings_.validate();
  if (landmarks.size() > 0) index_ = backend->makeDescriptorIndex(landmarks.descriptors);
}

std::vector<FeatureMatch> LandmarkMatcher::match(const ImageFeatures& features) const {
  if (features.size() == 0 || !index_) return {};
  if (features.descriptors.cols() != landmarks_->descriptors.cols()) {
    throw std::invalid_argument("the features are of another kind than the landmarks");
  }
  const int count = settings_.neighbours;
  const std::vector<Neighbour> all = index_->nearest(features.descriptors, count);
  const auto placeOf = [&](const Neighbour& one) -> Eigen::Vector3d {
    return landmarks_->places[static_cast<std::size_t>(one.row)].point.cast<double>();
  };
  std::vector<FeatureMatch> matches;
  for (int i = 0; i < features.size(); ++i) {
    const auto begin = all.begin() + std::ptrdiff_t{i} * count;
    const auto end =
        std::find_if(begin, begin + count, [](const Neighbour& n) { return n.row < 0; });
    const auto other = std::find_if(begin, end, [&](const Neighbour& one) {
      return apart(placeOf(one), placeOf(*begin), symmetries_) > other_place_;
    });
    const float ratio =
        other == end
            ? 0
            : std::sqrt(begin->squared_distance / std::max(other->squared_distance, 1e-12f));
    for (auto one = begin; one != end; ++one) {
      matches.push_back({i, one->row, ratio, static_cast<int>(one - begin)});
    }
  }
  return matches;
}

}  // namespace nerf_pose_refiner
