// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "nerf_pose_refiner/observation.h"
#include "refinement/covariance.h"

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

/// How far two opinions are apart [standard deviations].
double apart(const ViewOpinion& a, const ViewOpinion& b);

/// A pose of the camera after a twist of it about a point of O, @see cameraTwist.
Pose movedBy(const Vector6& twist, const Pose& T_O_C, const Eigen::Vector3d& centre);

/// What an error of a camera's place does to a twist about the object's centre.
/// @param position_dev [model units]. @param rotation_dev_rad of it, about each axis.
Matrix6 placeCovariance(const Pose& T_O_V, double position_dev, double rotation_dev_rad,
                        const FieldMetadata& object);

}  // namespace nerf_pose_refiner
