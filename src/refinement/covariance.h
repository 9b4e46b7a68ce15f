// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

#include "backend/hypotheses.h"
#include "field/field.h"
#include "geometry/matrix6.h"

namespace nerf_pose_refiner {

class ObjectFrame;
struct Prior;

/// The motion (v, w) of the camera from one pose to another: translation [model units] and rotation
/// [rad] about `centre`, both along the axes of O. Direct alignment solves for such motions.
/// @param centre of the object, in O [model units].
Vector6 cameraTwist(const Pose& from_T_O_C, const Pose& to_T_O_C, const Eigen::Vector3d& centre);

/// A hypothesis with the pose motion * T_O_C, and with its normal equations (for twists about
/// `centre` along the axes of O) transformed accordingly.
Hypothesis moved(const Hypothesis& hypothesis, const Pose& motion, const Eigen::Vector3d& centre);

/// Replaces each pose by the nearest one, in rotation, from which the object looks the same:
/// nearest to the prior for the best hypothesis, nearest to the best one for the others.
/// @param hypotheses best first; the best is live.
HypothesisTable nearestEquivalents(const HypothesisTable& hypotheses, const Prior& prior,
                                   const FieldMetadata& object);

/// diag(R, R): rotates both halves of a twist, or of a position and a rotation.
Matrix6 rotationOfTwists(const Eigen::Matrix3d& R);

/// The same covariance along rotated axes. @param R from the present axes to the new ones.
Matrix6 rotated(const Matrix6& covariance, const Eigen::Matrix3d& R);

/// Transfers a covariance of (position of a point, rotation), along the same axes, to another point
/// of the same body.
/// @param offset from the first point to the other.
Matrix6 atPoint(const Matrix6& covariance, const Eigen::Vector3d& offset);

/// The covariance of (motion of a point, rotation) without rotations about an axis.
/// @param axis in the same frame as `point`.
Matrix6 withoutTurns(const SymmetryAxis& axis, const Matrix6& covariance,
                     const Eigen::Vector3d& point);

/// The covariance of a twist about `centre` if the angle about an axis is unknown: it gets the
/// variance of a uniform angle, pi^2 / 3, and all else is unchanged.
/// @param axis in O [model units].
Matrix6 freeAbout(const SymmetryAxis& axis, const Matrix6& of_twist, const Eigen::Vector3d& centre);

/// Of a turn about an axis by an angle of that variance [rad^2]. @param point whose motion is told.
Matrix6 turnCovariance(const SymmetryAxis& axis, double variance, const Eigen::Vector3d& point);

/// Probabilities of the hypotheses by their losses; they sum to 1. Only live ones are not 0.
std::vector<double> hypothesisWeights(const HypothesisTable& hypotheses);

/// Hypotheses whose losses also say what else speaks for them, so that their weights are multiplied
/// by its odds; the best first. @param odds of a pose, above 0.
HypothesisTable weighed(const HypothesisTable& hypotheses,
                        const std::function<double(const Pose&)>& odds);

/// Covariance of the twist (v, w) between the best hypothesis and the true pose.
///
/// The sandwich estimate H^-1 G H^-1 of the final normal equations (Huber 1967): H is the
/// information of the residuals, G the scatter of the gradient over the tiles of the image, so that
/// residuals that are correlated, through blur or because the lighting is unknown, do not count as
/// independent. The error of the model (PoseStatistics) is added. Directions that the image does
/// not determine are as uncertain as the prior. Other hypotheses add the square of their distance,
/// by their weights. The angle about an axis of symmetry is unknown.
/// @param hypotheses as nearestEquivalents returns them.
Matrix6 poseCovariance(const HypothesisTable& hypotheses, const Prior& prior,
                       const FieldMetadata& object);

/// The part of it that is the model's error, and so that of all images of the object; without
/// turns about an axis of symmetry.
Matrix6 modelCovariance(const Pose& T_O_C, const FieldMetadata& object);

/// The axis about which images may say nothing of turns: the object looks the same from all around
/// it, as somebody declared, or nearly so.
std::optional<SymmetryAxis> axisOfLikeTurns(const FieldMetadata& object);

/// How well a pose explains an image, on the same scale for all objects: 0 as badly as wrong poses
/// did when the object was registered, 1 as well as the right ones did.
/// @param score of the backend; returned unchanged if the object has no statistics.
double calibratedScore(double score, const PoseStatistics& statistics);

/// The same for a score that is a fraction of the silhouette (colours were compared, not contrast):
/// 0 if at most half of it agrees.
double scoreOfFraction(double fraction);

/// The same uncertainty, for the object's pose in the camera: position of one of its points [model
/// units] and rotation [rad] about the axes of C, in the order x, y, z, about x, about y, about z.
/// @param point the origin of the frame whose pose it is, in O; the frame's axes do not matter.
Matrix6 covarianceInCamera(const Matrix6& of_twist, const Pose& T_O_C,
                           const Eigen::Vector3d& centre, const Eigen::Vector3d& point);

/// The same for the object's own frame, in its unit of length.
/// @param T_O_C of the best pose, model units. @param frame the object's own.
Matrix6 covarianceInCamera(const Matrix6& of_twist, const Pose& T_O_C, const FieldMetadata& object,
                           const ObjectFrame& frame);

/// The matrix of a cross product: crossOf(a) * b is a x b.
Eigen::Matrix3d crossOf(const Eigen::Vector3d& a);

}  // namespace nerf_pose_refiner
