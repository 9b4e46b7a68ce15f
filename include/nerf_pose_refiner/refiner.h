// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/object.h"
#include "nerf_pose_refiner/observation.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

class Backend;

// Lengths in this header are in metres if the object has a scale (Object::hasScale), else in model
// units; so are the lengths in covariances.

/// A rough pose, and how far it may be from the true one.
struct PosePrior {
  Pose T_C_O;  ///< the object in the camera's optical frame
  /// Half width of the search about each axis through the object's centre [rad].
  double rotation_rad = kSearchRotation_rad;
  /// Half width of the search along each axis [diameters of the object].
  double translation = kSearchTranslation;
};

/// One of the poses that a search found, with its probability.
struct WeightedPose {
  Pose T_C_O;         ///< the object in the camera's optical frame
  double weight = 0;  ///< probability, 0..1; the weights of one image sum to 1
};

/// The result of a search.
struct RefineResult {
  bool found = false;    ///< there is a pose, trusted or not; else T_C_O is the prior's
  bool trusted = false;  ///< the pose explains the image well enough to be used
  std::string message;   ///< why it is not trusted; empty if it is
  Pose T_C_O;            ///< the best pose: the object in the camera's optical frame
  /// Covariance of T_C_O: position of O's origin, then rotation, both along and about the axes of
  /// C, in the order x, y, z, about x, about y, about z [length^2, rad^2] (as in geometry_msgs).
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double score = 0;  ///< 0..1: probability that the pose is right, within 5 degrees and 5 %
  double visible_fraction = 0;  ///< fraction of the silhouette that agrees with the image, 0..1
  DepthReport depth;            ///< what became of the observation's depth
  std::vector<SideViewReport> side_views;  ///< what became of its side views, in their order
  double seconds = 0;                      ///< duration of the search
  std::vector<WeightedPose> hypotheses;    ///< poses of the last stage, best first
};

/// How a pose is searched for.
struct RefinerOptions {
  /// "keyframes": aligns renderings from around the object with the image, the fastest on a CPU.
  /// They are kept for the next images. Searches without masks, and does not trust a pose that a
  /// mask contradicts. "align": renders the field for each step, coarse to fine; uses masks.
  /// "track": the same with fewer stages, for a prior that is nearly right. "paper",
  /// "paper_single": parallel inversion (Lin et al., ICRA 2023).
  std::string preset = "keyframes";
  double trust_score = 0.9;  ///< a pose with a lower score is not trusted, 0..1
  std::uint64_t seed = 1;    ///< the same seed, backend and calls give the same results
};

/// Finds the pose of an object in one image, near a prior.
///
/// It keeps the keyframes of earlier images and what these have shown of a depth sensor's bias, so
/// that images of one place and one sensor are best given to one refiner.
///
/// Not thread-safe; refiners of several threads may share a backend.
class Refiner {
 public:
  /// @throws std::invalid_argument for an unknown preset, std::runtime_error if the backend has too
  /// little memory.
  Refiner(std::shared_ptr<Backend> backend, const Object& object,
          const RefinerOptions& options = {});
  ~Refiner();
  Refiner(Refiner&&) noexcept;
  Refiner& operator=(Refiner&&) noexcept;

  /// @throws std::invalid_argument for an invalid image or prior (sizes, NaN), std::runtime_error
  /// if the processor fails (@see makeBackend), Cancelled.
  RefineResult refine(const Observation& observation, const PosePrior& prior,
                      const CancellationToken& cancellation = {});

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace nerf_pose_refiner
