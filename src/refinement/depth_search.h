// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <map>
#include <memory>
#include <vector>

#include "backend/loaded_field.h"
#include "refinement/depth_fit.h"
#include "refinement/field_refiner.h"
#include "views/view_bank.h"

namespace nerf_pose_refiner {

/// Looks for an object in a depth image where there is no colour image. Not thread-safe.
class DepthSearch {
 public:
  DepthSearch(std::shared_ptr<const LoadedField> field, const ViewBankSettings& bank);

  /// Looks everywhere in a wide prior, with small views of the object, which are rendered on first
  /// use. @return best first: poses that are nearly right, if one is. @throws Cancelled.
  std::vector<DepthFit> around(const DepthImage& depth, const DepthPrior& known, const Prior& prior,
                               const CancellationToken& cancellation);

  /// Poses beside one that `from` found, along the motion that depth fixes least, with their
  /// evidence: the learned surface is rough, and its bumps seem to fix what the shape leaves open.
  std::vector<DepthFit> beside(const DepthImage& depth, const DepthFit& found) const;

  /// Aligns what a keyframe shows from each of some poses. @return best first. @throws Cancelled.
  std::vector<DepthFit> from(const DepthImage& depth, const DepthPrior& known,
                             const std::shared_ptr<const KeyframePoints>& keyframe,
                             const std::vector<Pose>& poses_T_O_C,
                             const CancellationToken& cancellation);

 private:
  /// A small view's surface, finely and coarsely.
  struct SmallView {
    DepthSurface fine, coarse;
  };

  const SmallView& nearestView(const Pose& T_O_C, const CancellationToken& cancellation);

  std::shared_ptr<const LoadedField> field_;
  std::shared_ptr<ViewBank> bank_;
  std::map<int, SmallView> views_;                  // by their numbers in the bank
  std::shared_ptr<const KeyframePoints> keyframe_;  // that surface_ was taken from
  DepthSurface surface_;
};

/// How likely a pose is right, by what the depth image shows alone: whether surface and outline are
/// where the pose puts them, and whether the object's shape is needed to explain that.
double depthProbability(const DepthFit& fit);

/// What poses that explain a depth image nearly as well add to the best one's covariance.
/// @param fits best first, one at least.
Matrix6 spreadOf(const std::vector<DepthFit>& fits, const FieldMetadata& object);

}  // namespace nerf_pose_refiner
