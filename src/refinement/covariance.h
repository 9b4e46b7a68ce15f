// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "backend/hypotheses.h"
#include "field/field.h"

namespace nerf_pose_refiner {

class ObjectFrame;
struct Prior;

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// The motion (v, w) of the camera that leads from one pose to another: translation [model units]
/// and rotation [rad] about `centre`, both in the axes of O. It is what direct alignment solves
/// for.
/// @param centre of the object, in O [model units].
Vector6 cameraTwist(const Pose& from_T_O_C, const Pose& to_T_O_C, const Eigen::Vector3d& centre);

/// A hypothesis seen from another side of the object: its pose becomes motion * T_O_C, and its
/// normal equations, which are of twists about `centre` in the axes of O, follow.
Hypothesis moved(const Hypothesis& hypothesis, const Pose& motion, const Eigen::Vector3d& centre);

/// Of all poses from which the object looks alike, those nearest in rotation: of the best
/// hypothesis to the prior, of the others to the best one.
/// @param hypotheses best first, the best being live.
HypothesisTable nearestEquivalents(const HypothesisTable& hypotheses, const Prior& prior,
                                   const FieldMetadata& object);

/// The covariance of (position of a point, rotation), both in the same axes, as that of another
/// point of the same body.
/// @param offset from the first point to the other.
Matrix6 atPoint(const Matrix6& covariance, const Eigen::Vector3d& offset);

/// The covariance of (motion of a point, rotation) without turns about an axis.
/// @param axis in the axes, and relative to the origin, that `point` is given in.
Matrix6 withoutTurns(const SymmetryAxis& axis, const Matrix6& covariance,
                     const Eigen::Vector3d& point);

/// The covariance of a twist about `centre` if nothing is known of the angle about an axis: there
/// it has the variance of a uniform angle, pi^2 / 3, whatever it was; what remains is unchanged.
/// @param axis in O [model units].
Matrix6 freeAbout(const SymmetryAxis& axis, const Matrix6& of_twist, const Eigen::Vector3d& centre);

/// Axes of a camera turned such that z goes through a point; columns in C.
Eigen::Matrix3d lineOfSightAxes(const Eigen::Vector3d& point_C);

/// Weights of the hypotheses in the belief, by their losses; they sum to 1. Flagged ones have 0.
std::vector<double> hypothesisWeights(const HypothesisTable& hypotheses);

/// How far the best hypothesis may be from the truth: covariance of the twist (v, w) between them.
///
/// The sandwich H^-1 G H^-1 of the final normal equations (Huber 1967): H says how residuals change
/// with the pose, G how the gradient varies from tile to tile of the image, so that residuals
/// that go together, through blur or because the model does not know the lighting, are not taken
/// for independent ones. What the model itself is off by (PoseStatistics) is added. What the image
/// does not fix is as uncertain as the prior; other hypotheses add their distance, by their
/// weights. About an axis of symmetry any angle is as good.
/// @param hypotheses as nearestEquivalents has them.
Matrix6 poseCovariance(const HypothesisTable& hypotheses, const Prior& prior,
                       const FieldMetadata& object);

/// How well a pose explains an image, on a scale that holds for all objects: 0 as badly as wrong
/// poses did when the object was registered, 1 as well as the right ones did.
/// @param score as the backend has it; returned as it is if nothing was measured.
double calibratedScore(double score, const PoseStatistics& statistics);

/// The same of a keyframe's score (KeyframeAligner::align).
double keyframeScore(double score, const PoseStatistics& statistics);

/// The same of a score that is a fraction of the silhouette (colours were compared, not contrasts):
/// 0 if no more than half of it agrees.
double scoreOfFraction(double fraction);

/// The same uncertainty as that of the object's pose in the camera: position of one of its points
/// [model units] and rotation [rad] about the axes of C, order (x, y, z, about x, about y, about
/// z).
/// @param point the origin of the frame whose pose it is, in O; its axes do not matter.
Matrix6 covarianceInCamera(const Matrix6& of_twist, const Pose& T_O_C,
                           const Eigen::Vector3d& centre, const Eigen::Vector3d& point);

/// The same of the object's own frame, in its users' unit of length.
/// @param T_O_C of the best pose, model units. @param frame the object's own.
Matrix6 covarianceInCamera(const Matrix6& of_twist, const Pose& T_O_C, const FieldMetadata& object,
                           const ObjectFrame& frame);

}  // namespace nerf_pose_refiner
