// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "field/field.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// How likely a pose that keyframes found is right, by what the image shows alone: a logistic curve
/// between the scores that wrong and right poses of this object have.
/// @param score 0..1, @see KeyframeAligner::align. @param scores if they are unknown, those of a
/// plain object count.
double scoreProbability(double score, const KeyframeScores& scores);

/// The same where wrong poses were tried in this very image, whose scores say more than those in
/// others: the score at which right and wrong are equally likely is a weighted mean, three fifths
/// the best one's and 0.26 more, two fifths the object's even score.
/// @param rolled_score the best one's, 0..1, @see RolledScores; nothing: it is not known.
double scoreProbability(double score, const std::optional<double>& rolled_score,
                        const KeyframeScores& scores);

/// The score at which a pose is as likely right as wrong by the object's scores in general.
double evenScore(const KeyframeScores& scores);

/// The factor by which a track changes the odds of the pose that continues it: objects rarely
/// vanish between two images, and wrong poses are rarely where the motion leads.
inline constexpr double kTrackOdds = 20;
/// The same for a pose where somebody says that the object is.
inline constexpr double kHintOdds = 3;

/// A pose this unlikely is given up where another image comes soon: a keyframe of its own place
/// might still make it right, but takes as long again.
inline constexpr double kHopelessProbability = 0.005;

/// The score at which the image alone gives a pose these odds. @see scoreProbability
double scoreOfOdds(double odds, const KeyframeScores& scores);

/// A pose that scores less explains the image hardly better than wrong ones do.
double doubtfulScore(const KeyframeScores& scores);

/// To the corner of what is uniform along each axis [half widths of a prior].
inline constexpr double kWithinPrior = 1.75;

/// How far a pose is from a prior, in half widths of it (or of the least width that a prior has).
double distanceFromPrior(const Pose& T_O_C, const Prior& prior, const FieldMetadata& object);

/// The factor by which a prior changes the odds of a pose: 1 within reach of the search, less
/// beyond. Wrong poses are found anywhere, right ones where they are expected.
double priorOdds(const Pose& T_O_C, const Prior& prior, const FieldMetadata& object);

/// A probability after evidence that changes the odds by a factor.
double withOdds(double probability, double odds);

/// The same of a pose that was refined: of how likely it was found, and of its score.
void changeOdds(double odds, Refinement* refined);

/// How likely a pose is within 5 degrees and 5 % of the diameter if its errors have a covariance.
/// @param of_twist @see poseCovariance.
double withinProbability(const Matrix6& of_twist, const FieldMetadata& object);

/// What errors of the model and of its shading add to a covariance: they do not keep to the
/// correlations that noise has, and are larger than it.
/// @param of_twist by noise alone. @param T_O_C its pose.
Matrix6 systematicCovariance(const Matrix6& of_twist, const Pose& T_O_C,
                             const FieldMetadata& object);

/// Covariance of a pose that keyframes found, as a twist: of noise, and of errors of the model.
/// @see poseCovariance, systematicCovariance, besideFactor.
Matrix6 keyframeCovariance(const HypothesisTable& hypotheses, const Prior& prior,
                           const FieldMetadata& object);

/// How many times the variances of errors of the model count with a keyframe from so far beside the
/// pose, which shows the surface and its shading as they are seen from there: once with one of its
/// own place, twice from 8 degrees. (Errors of a desk lamp on recordings grew like that.)
double besideFactor(double beside_rad);

/// The covariance that two keyframes show by ending apart, as a twist of the pose. Where an image
/// holds a turn badly, a keyframe drags the pose a share of the way to where it was rendered: if
/// the second one turns the object by as much as it was rendered beside it, the image does not fix
/// that turn. The first one drags by the same share of its own way.
/// @param away from the pose to where the second keyframe is aligned, @see cameraTwist.
/// @param beside_rad how far beside the pose that one was rendered. @param own_beside_rad the same
/// of the keyframe that found the pose.
Matrix6 disagreement(const Vector6& away, double beside_rad, double own_beside_rad);

/// A score of alignment to the field (calibratedScore, scoreOfFraction) on the scale of
/// probabilities: 0.1 is as likely right as wrong, 0.18 right in nine of ten cases.
double fieldScoreProbability(double score);

/// How much likelier an object's own colours make a pose than those in the image do, @see
/// chromaticDifference: 1 to 0.01. With right poses of six objects in light that is up to 30 % off
/// in each channel and noise, 95 of 100 differed by less than 0.1, the most by 0.19; with a vividly
/// coloured object whose channels were exchanged, all by more than 0.2.
double oddsOfColours(const std::optional<double>& chromatic_difference);

}  // namespace nerf_pose_refiner
