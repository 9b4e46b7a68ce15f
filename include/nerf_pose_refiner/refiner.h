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

/// Where an object is thought to be in an image, and how far off that may be.
struct PosePrior {
  Pose T_C_O;  ///< the object in the camera's optical frame [m]
  /// Half width of the search about each axis through the object's centre [rad].
  double rotation_rad = 0.26;
  /// Half width of the search along each axis [diameters of the object].
  double translation = 0.15;
};

/// A pose that the search found, and how much of the belief it holds.
struct WeightedPose {
  Pose T_C_O;         ///< [m]
  double weight = 0;  ///< 0..1; those of one image sum to 1
};

/// What came of a search.
struct RefineResult {
  bool trusted = false;  ///< the pose explains the image well enough to act on it
  std::string message;   ///< why it is not trusted; empty if it is
  Pose T_C_O;            ///< the best pose: object in the camera's optical frame [m]
  /// Of the position of O's origin and of the rotation about the axes of C, in the order x, y, z,
  /// about x, about y, about z [m^2, rad^2] (REP-103).
  Eigen::Matrix<double, 6, 6> covariance = Eigen::Matrix<double, 6, 6>::Zero();
  double score = 0;  ///< 0: as badly as wrong poses of this object; 1: as well as right ones
  double visible_fraction = 0;  ///< of the object's silhouette that agrees with the image, 0..1
  double seconds = 0;
  std::vector<WeightedPose> hypotheses;  ///< all that were refined to the end, best first
};

/// How the search is done.
struct RefinerOptions {
  /// "align": direct alignment, coarse to fine. "track": the same, from a pose that is nearly
  /// right. "paper", "paper_single": parallel inversion (Lin et al., ICRA 2023).
  std::string preset = "align";
  double trust_score = 0.18;  ///< a pose with a lower score is not trusted, 0..1
  std::uint64_t seed = 1;     ///< same seed, same backend: same answer
};

/// Finds the pose of an object in one image, near a prior.
///
/// Not thread-safe; refiners of several threads may share a backend.
class Refiner {
 public:
  /// @throws std::invalid_argument for an unknown preset, std::runtime_error where the backend has
  /// no memory for the object.
  Refiner(std::shared_ptr<Backend> backend, const Object& object,
          const RefinerOptions& options = {});
  ~Refiner();
  Refiner(Refiner&&) noexcept;
  Refiner& operator=(Refiner&&) noexcept;

  /// @throws std::invalid_argument for an image or a prior that makes no sense (sizes, NaN),
  /// Cancelled.
  RefineResult refine(const Observation& observation, const PosePrior& prior,
                      const CancellationToken& cancellation = {});

 private:
  struct Parts;
  std::unique_ptr<Parts> parts_;
};

}  // namespace nerf_pose_refiner
