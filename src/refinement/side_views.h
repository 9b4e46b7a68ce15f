// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "refinement/field_refiner.h"
#include "refinement/keyframe_search.h"
#include "views/keyframe_renderer.h"

namespace nerf_pose_refiner {

/// What one image says of the pose, as a motion of all cameras from a common pose: cameras that
/// stand fixed to each other move by one twist about the object's centre, in the axes of O.
struct ViewOpinion {
  Vector6 twist = Vector6::Zero();
  Matrix6 noise = Matrix6::Identity();  ///< covariance of this image alone
  Matrix6 model = Matrix6::Zero();      ///< that of the model's error, which images share
};

/// What images say together: their normal equations are added. Errors of the model count as the
/// same in all of them, so that more images do not lessen them.
ViewOpinion joined(const std::vector<ViewOpinion>& opinions);

/// The further cameras of an observation, each with its keyframes.
class SideViews {
 public:
  SideViews(Backend* backend, std::shared_ptr<const LoadedField> field,
            const KeyframeSearchSettings& settings)
      : backend_(backend), field_(std::move(field)), settings_(settings) {}

  /// Joins what side views say to what the observation's own image says. Where that shows the
  /// object badly, the others find it from the prior.
  /// @param found of the own image, its probability by `scores` included.
  void join(const Observation& observation, const Prior& prior, const KeyframeScores& scores,
            const CancellationToken& cancellation, Refinement* found);

  /// Waits until nothing is rendered any more.
  void waitForRenderings(const CancellationToken& cancellation);

 private:
  struct Camera;
  struct Found;

  Camera* camera(std::size_t i);
  ViewOpinion opinionOf(const SideView& view, const Found& side) const;
  static bool agrees(const ViewOpinion& opinion, std::vector<ViewOpinion>* opinions,
                     SideViewReport* report);
  Found look(const SideView& view, const Prior& prior, const CancellationToken& cancellation,
             Camera* camera);
  bool haveKeyframe(const View& view, const CancellationToken& cancellation, Camera* camera);

  Backend* backend_;
  std::shared_ptr<const LoadedField> field_;
  KeyframeSearchSettings settings_;
  std::vector<std::shared_ptr<Camera>> cameras_;  // in the order of the observation's views
};

}  // namespace nerf_pose_refiner
