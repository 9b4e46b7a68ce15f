// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// An axis about which an object may be turned by any angle: that of a plain bottle.
struct SymmetryAxis {
  Eigen::Vector3d direction = Eigen::Vector3d::UnitZ();  ///< of length 1
  Eigen::Vector3d point = Eigen::Vector3d::Zero();       ///< any on the axis
};

/// The motion that turns everything by an angle about an axis.
Pose turnAbout(const SymmetryAxis& axis, double angle_rad);

/// Motions of an object after which it looks as before. They make a group: the products of some are
/// others. All are in the object's frame O, so that a pose T_C_O is as good as T_C_O * S.
class Symmetries {
 public:
  /// Most motions beside those about the axis: twice those of an icosahedron.
  static constexpr std::size_t kMaxMotions = 120;

  /// None: the object looks different from everywhere.
  Symmetries() = default;

  /// All products of motions that are given.
  /// @param axis any turn about it; its direction is normalised here.
  /// @param given finitely many others: the flip of a plain cylinder, the quarter turn of a square
  /// box.
  /// @throws std::invalid_argument if they cannot be the symmetries of a solid object: one is not
  /// rigid, does not map the axis onto itself, or their products come to no end.
  Symmetries(const std::optional<SymmetryAxis>& axis, const std::vector<Pose>& given);

  bool any() const { return axis_ || motions_.size() > 1; }
  const std::optional<SymmetryAxis>& axis() const { return axis_; }
  /// The group, the identity first; of those that differ by a turn about the axis, one.
  const std::vector<Pose>& motions() const { return motions_; }

  /// The motion S that brings the orientation R_C_O * S.R nearest to a reference.
  Pose nearest(const Eigen::Matrix3d& R_C_O, const Eigen::Matrix3d& reference_R_C_O) const;

  /// The same symmetries in frame N.
  Symmetries inFrame(const Pose& T_N_O) const;
  /// The same in another unit of length. @param length_per_unit of the present one, in the new one.
  Symmetries scaled(double length_per_unit) const;

 private:
  std::optional<SymmetryAxis> axis_;
  std::vector<Pose> motions_ = {Pose()};
};

/// In words: "any turn about an axis, and 1 motion"; empty for none.
std::string describe(const Symmetries& symmetries);

/// Of the camera's poses from which the object looks as from T_O_C, the one whose orientation is
/// nearest to that of a reference.
Pose nearestEquivalent(const Pose& T_O_C, const Pose& reference_T_O_C,
                       const Symmetries& symmetries);

}  // namespace nerf_pose_refiner
