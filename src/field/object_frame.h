// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>

#include "field/field.h"

namespace nerf_pose_refiner {

/// The one place where poses change between the library, which has the camera's T_O_C in the
/// model's frame O in model units, and its users, who speak of T_C_U: the pose in the camera's
/// optical frame of the frame U that they mean by the object's (FieldMetadata::T_O_U), in their
/// unit of length.
class ObjectFrame {
 public:
  /// @param length_per_unit users' units of length in a model unit.
  ObjectFrame(const Pose& T_O_U, double length_per_unit)
      : T_O_U_(T_O_U), length_per_unit_(length_per_unit) {}
  /// For users who count in metres. @pre object.metres_per_unit > 0
  static ObjectFrame inMetres(const FieldMetadata& object) {
    return {object.T_O_U, object.metres_per_unit};
  }
  /// For users who count in metres if the object knows its scale, else in model units.
  static ObjectFrame ofUsers(const FieldMetadata& object) {
    return object.metres_per_unit > 0 ? inMetres(object) : inModelUnits(object);
  }
  /// For users who count in model units.
  static ObjectFrame inModelUnits(const FieldMetadata& object) { return {object.T_O_U, 1}; }

  /// T_C_U [users' unit] of T_O_C [model units].
  Pose objectInCamera(const Pose& T_O_C) const;
  /// The inverse: T_O_C [model units] of T_C_U [users' unit].
  Pose cameraInModel(const Pose& T_C_U) const;

  /// A point p_U [users' unit] of p_O [model units].
  Eigen::Vector3d point(const Eigen::Vector3d& p_O) const;

  /// U's origin in O [model units].
  const Eigen::Vector3d& origin() const { return T_O_U_.t; }
  /// Users' units of length in a model unit.
  double lengthPerUnit() const { return length_per_unit_; }

 private:
  Pose T_O_U_;  // [model units]
  double length_per_unit_;
};

/// Corners of the box around an object, in frame U of its users [their unit]; bit i of an index
/// says which end of axis i it is at. Edges need not be parallel to U's axes if no box was given.
std::array<Eigen::Vector3d, 8> boxCorners(const Field& field, const ObjectFrame& frame);

}  // namespace nerf_pose_refiner
