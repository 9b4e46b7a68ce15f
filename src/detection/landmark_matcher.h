// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "detection/image_features.h"
#include "detection/landmarks.h"
#include "nerf_pose_refiner/symmetry.h"

namespace nerf_pose_refiner {

/// A feature of an image and the landmark that looks most like it.
struct FeatureMatch {
  int feature = 0;
  int landmark = 0;
  /// Of its descriptor's distances to the most similar landmark and to the next place, at most 1;
  /// 0: none of the neighbours is of another place.
  float ratio = 0;
  int rank = 0;  ///< of the landmark among those that the feature looks like; 0: the most similar
};

struct MatchingSettings {
  double other_place = 0.05;  ///< landmarks farther apart are other places [diameters]
  int neighbours = 6;         ///< of a feature: so many matches
  int checks = 64;            ///< leaves of the trees that a search looks at
  int threads = 0;            ///< 0: all cores; in a detector: those of its backend
};

/// Finds the landmarks that features of images look like, by a forest of randomised kd-trees
/// (Silpa-Anan and Hartley 2008). Any thread may search.
class LandmarkMatcher {
 public:
  /// @param landmarks live longer. @param diameter of the object [model units].
  /// @param symmetries of the object: places that look alike by them are one.
  LandmarkMatcher(const Landmarks& landmarks, double diameter, const MatchingSettings& settings,
                  const Symmetries& symmetries = {});
  ~LandmarkMatcher();
  LandmarkMatcher(LandmarkMatcher&&) noexcept;

  /// The neighbours of each feature, feature by feature. @throws std::invalid_argument for features
  /// of another kind than the landmarks.
  std::vector<FeatureMatch> match(const ImageFeatures& features) const;

 private:
  struct Trees;

  const Landmarks* landmarks_;
  double other_place_;  // [model units]
  Symmetries symmetries_;
  MatchingSettings settings_;
  std::unique_ptr<Trees> trees_;  // null: there are no landmarks
};

}  // namespace nerf_pose_refiner
