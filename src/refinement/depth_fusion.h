// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "backend/keyframe_points.h"
#include "nerf_pose_refiner/depth.h"
#include "refinement/depth_delay.h"
#include "refinement/depth_fit.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// Joins what depth says of an object's pose to what colours say, from image to image: learns the
/// sensor's bias, and whether the sensor can be believed.
///
/// Colours decide: depth that contradicts them is refused with the reason, and leaves the pose as
/// it was. Once depth has agreed with trusted poses for some images, a place that it sees through
/// speaks against the pose.
class DepthFusion {
 public:
  /// Betters a pose that colours gave, with its covariance and its depth report.
  /// @param keyframe that shows the object about as the pose does; null: there is none.
  /// @param motion of the camera, as a twist a second; zero: it is not known.
  /// @return the factor by which depth changes the odds that the pose is right.
  double fuse(const DepthImage& depth, const std::shared_ptr<const KeyframePoints>& keyframe,
              const FieldMetadata& object, const Vector6& motion, Refinement* found);

  /// What is known where depth is alone: the bias as it was learnt so far.
  DepthPrior priorAlone(const DepthNoise& noise, const FieldMetadata& object,
                        const Prior& prior) const;

  /// Where depth alone puts the object, near a prior that is nearly right. Nothing: it does not
  /// say.
  std::optional<Pose> alone(const DepthImage& depth,
                            const std::shared_ptr<const KeyframePoints>& keyframe,
                            const FieldMetadata& object, const Prior& prior);

  /// Whether depth has agreed with enough images to be believed before it is compared.
  bool isEstablished() const { return agreed_ >= kEstablished; }

 private:
  static constexpr int kEstablished = 5;

  /// The sensor's bias and its variance [m, m^2].
  struct Bias {
    double mean_m = 0, variance_m2 = 0;
  };

  bool lookAt(const std::shared_ptr<const KeyframePoints>& keyframe);
  Bias biasAt(const DepthNoise& noise, double distance_m) const;
  std::string objection(const DepthFit& fit) const;
  void learnDelay(const DepthImage& depth, const FieldMetadata& object, const Vector6& motion,
                  const Refinement& found);
  void learn(const DepthFit& fit, const Bias& before, const DepthNoise& noise, double distance_m,
             double metres_per_unit);

  std::shared_ptr<const KeyframePoints> keyframe_;  // that surface_ was taken from
  DepthSurface surface_;
  std::optional<Bias> bias_;
  double learnt_at_m_ = 0;  // distance of the object
  double surprise_ = 0;     // mean squared distance between what colours say and what is joined
  DepthDelay delay_;
  int agreed_ = 0;
};

}  // namespace nerf_pose_refiner
