// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "backend/backend.h"
#include "nerf_pose_refiner/symmetry.h"
#include "ros/bag/bag_sequence.h"
#include "ros/conversions/parameters.h"
#include "tracking/object_tracker.h"

namespace nerf_pose_refiner {

/// A bag's images, decoded, each with the object's true pose.
struct Recording {
  struct Image {
    BagFrame frame;
    Pose true_T_C_U;  ///< [m]
  };
  std::vector<Image> images;

  /// @throws std::runtime_error as BagSequence, and for an image without a true pose.
  static Recording of(const BagSequence& bag);
};

/// How runs are drawn, and what is asked of them.
struct TrustSettings {
  int images = 20;                  ///< of a run, >= 1
  int every = 1;                    ///< n-th image of a recording is processed, >= 1
  int before = 5;                   ///< images of a run before the object goes, >= 1
  int limit = 10;                   ///< processed images within which it must be lost then, >= 1
  int after = 2;                    ///< images of a run on which a lost object is looked for, >= 0
  double start_rotation_deg = 15;   ///< of initial poses: half width per axis, about the centre
  double start_translation = 0.15;  ///< the same per axis of the camera [object diameters]
  double right_rotation_deg = 5;    ///< up to which a pose is right ...
  double right_offset = 0.05;       ///< ... and its centre [object diameters]
  std::uint64_t seed = 1;           ///< of the runs

  /// @throws std::invalid_argument naming what is out of range.
  void validate() const;
};

/// What came of the images of runs.
struct PublishedPoses {
  int images = 0;
  int right = 0;      ///< refined to a right pose, published or not
  int published = 0;  ///< poses
  int published_right = 0;

  PublishedPoses& operator+=(const PublishedPoses& other);
};

/// What came of a run in which the object goes.
struct Disappearance {
  bool tracked = false;  ///< when it went
  int lost_after = 0;    ///< processed images without the object until it was called lost; 0: never
  int published = 0;     ///< poses of what was not there
};

/// Runs of the tracker over recorded images: without a ROS graph, image after image, on
/// the recording's clock. The same settings and processor give the same numbers.
class TrustTrials {
 public:
  /// @param parameters of the node. @throws std::invalid_argument for settings that make no sense
  /// or a model without a scale.
  TrustTrials(std::shared_ptr<Backend> backend, std::shared_ptr<const Field> field,
              const PoseRefinerParameters& parameters, const TrustSettings& settings);

  /// Tracks the object from an initial pose in an image that is drawn.
  PublishedPoses track(const Recording& recording, int run);

  /// Tracks it, and goes on with a recording on which it is gone from an image that is drawn.
  /// @param gone stamps are those of `recording`, or of a part of it: the same camera's motion.
  /// @throws std::runtime_error if the two have not enough images in common.
  Disappearance lose(const Recording& recording, const Recording& gone, int run);

 private:
  class Run;
  Pose initialPose(const Pose& true_T_C_U, int run) const;
  bool isRight(const TrackOutcome& result, const Pose& true_T_C_U) const;

  std::shared_ptr<Backend> backend_;
  std::shared_ptr<const Field> field_;
  PoseRefinerParameters parameters_;
  TrustSettings settings_;
  double diameter_m_;
  Eigen::Vector3d centre_m_;  ///< in U
  Symmetries symmetries_m_;
};

}  // namespace nerf_pose_refiner
