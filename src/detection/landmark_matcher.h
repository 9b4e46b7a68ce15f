// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/backend.h"
#include "backend/descriptor_index.h"
#include "detection/image_features.h"
#include "detection/landmarks.h"
#include "nerf_pose_refiner/symmetry.h"

namespace nerf_pose_refiner {

struct FieldMetadata;

/// A feature of an image and a landmark that looks like it.
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

  /// @throws std::invalid_argument naming the value that is out of range.
  void validate() const;
};

/// Finds the landmarks that features of images look like. One caller at a time.
class LandmarkMatcher {
 public:
  /// @param landmarks live longer. @param object of them; places that look alike by its symmetries
  /// are one. @throws std::invalid_argument for settings that are out of range.
  LandmarkMatcher(Backend* backend, const Landmarks& landmarks, const FieldMetadata& object,
                  const MatchingSettings& settings);

  /// The neighbours of each feature, feature by feature. @throws std::invalid_argument for features
  /// of another kind than the landmarks.
  std::vector<FeatureMatch> match(const ImageFeatures& features) const;

 private:
  const Landmarks* landmarks_;
  double other_place_;  // [model units]
  Symmetries symmetries_;
  MatchingSettings settings_;
  std::unique_ptr<DescriptorIndex> index_;  // null: there are no landmarks
};

}  // namespace nerf_pose_refiner
