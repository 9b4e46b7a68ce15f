// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <vector>

#include "backend/loaded_field.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// Points on an object's surface, by which poses are compared as in BOP and its forerunners.
/// Lengths are in the unit of points and poses. May be used from many threads at once.
class ModelPoints {
 public:
  /// @param points_O in O. @throws std::invalid_argument for none, or one that is not finite.
  explicit ModelPoints(std::vector<Eigen::Vector3d> points_O);
  ~ModelPoints();
  ModelPoints(ModelPoints&&) noexcept;
  ModelPoints& operator=(ModelPoints&&) noexcept;

  const std::vector<Eigen::Vector3d>& points() const { return points_O_; }

  /// ADD: mean distance between the same points under two poses, as the camera sees them
  /// (Hinterstoisser et al., ACCV 2012).
  double add(const Pose& T_O_C, const Pose& true_T_O_C) const;

  /// ADD-S: mean distance of each point under the true pose to the nearest one under the other;
  /// for objects that look alike from several sides.
  double addS(const Pose& T_O_C, const Pose& true_T_O_C) const;

  /// Mean distance between the same points in the image [px]; infinite if one of them lies behind
  /// a camera.
  double reprojection(const Pose& T_O_C, const Pose& true_T_O_C, const Camera& camera) const;

 private:
  struct Tree;
  std::vector<Eigen::Vector3d> points_O_;
  std::unique_ptr<Tree> tree_;
};

/// Points that a field shows to cameras all around it: the expected points of opaque pixels, one
/// for each cell of a fine grid at most, and of those `count`, drawn by `seed`.
/// @return in O [model units]; fewer if the surface is not resolved into so many.
/// @throws std::invalid_argument for a count below 1, std::runtime_error if nothing is opaque,
/// Cancelled.
std::vector<Eigen::Vector3d> surfacePoints(const LoadedField& field, int count, std::uint64_t seed,
                                           const CancellationToken& cancellation = {});

}  // namespace nerf_pose_refiner
