// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <geometry_msgs/Point.h>
#include <geometry_msgs/PoseArray.h>
#include <geometry_msgs/PoseStamped.h>
#include <geometry_msgs/PoseWithCovarianceStamped.h>
#include <geometry_msgs/TransformStamped.h>
#include <geometry_msgs/TwistWithCovariance.h>
#include <nerf_pose_refiner/PoseHypothesisArray.h>

#include <string>

#include "backend/hypotheses.h"
#include "field/field.h"
#include "nerf_pose_refiner/pose.h"
#include "refinement/field_refiner.h"
#include "tracking/status.h"
#include "tracking/timed_pose.h"
#include "tracking/velocity.h"

namespace nerf_pose_refiner {

/// A frame as TF2 names it: TF1 put a slash before the name, and old drivers and bags still do.
std::string withoutSlash(const std::string& frame_id);

geometry_msgs::Point toPoint(const Eigen::Vector3d& p);

geometry_msgs::Pose toMessage(const Pose& pose);

/// @throws InputError if a number is not finite or the quaternion is off unit length by over 1 %.
Pose fromMessage(const geometry_msgs::Pose& message);

Pose fromMessage(const geometry_msgs::Transform& message);

geometry_msgs::TransformStamped toTransform(const geometry_msgs::PoseStamped& pose,
                                            const std::string& child_frame);

/// An initial pose. @throws InputError if it is invalid or names no frame.
TimedPose initialPoseFrom(const geometry_msgs::PoseStamped& message);

/// The same with its covariance, unless that is all zeros.
/// @throws InputError also for a covariance that is not finite or has a negative variance.
TimedPose initialPoseFrom(const geometry_msgs::PoseWithCovarianceStamped& message);

/// A covariance in messages, row by row.
using CovarianceMessage = geometry_msgs::PoseWithCovariance::_covariance_type;
Matrix6 fromMessage(const CovarianceMessage& message);
CovarianceMessage toMessage(const Matrix6& covariance);

/// The covariance of a pose as REP-103 defines it: position of the origin of the object's frame U
/// [m^2] and rotation about the fixed axes of W [rad^2], row-major, order (x, y, z, about x, about
/// y, about z).
/// @param of_twist as Refinement::covariance. @param T_O_C in model units.
/// @param R_W_C rotation from the camera to W.
CovarianceMessage covarianceToMessage(const Matrix6& of_twist, const Pose& T_O_C,
                                      const FieldMetadata& object, const Eigen::Matrix3d& R_W_C);

/// A refined pose for ROS: the object's frame U in W.
/// @param T_W_C the camera in W [m].
geometry_msgs::PoseWithCovariance toMessage(const Refinement& refinement, const Pose& T_W_C,
                                            const FieldMetadata& object);

/// Live, measured hypotheses of one image as poses of the object's frame U in W, the best first,
/// with their hypothesisWeights.
/// @param T_W_C the camera in W [m]. Header and object's name are left to the caller.
PoseHypothesisArray toMessage(const HypothesisTable& hypotheses, const Pose& T_W_C,
                              const FieldMetadata& object);

geometry_msgs::TwistWithCovariance toMessage(const Velocity& velocity);

geometry_msgs::PoseArray toPoseArray(const PoseHypothesisArray& message);

}  // namespace nerf_pose_refiner
