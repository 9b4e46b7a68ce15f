// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/motion_filter.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>
#include <utility>

namespace nerf_pose_refiner {
namespace {

// The covariance of a camera's twist about the object's centre, along the axes of O, is that of the
// object's motion before the camera, but for the axes.
Matrix6 alongCamera(const Matrix6& of_twist, const Pose& T_O_C) {
  return rotated(of_twist, T_O_C.R.transpose());
}

Vector6 motionBetween(const Pose& from_T_O_C, const Pose& to_T_O_C, const FieldMetadata& object) {
  const Pose from = from_T_O_C.inverse(), to = to_T_O_C.inverse();
  Vector6 motion;
  motion.head<3>() = to * object.centre - from * object.centre;
  motion.tail<3>() = logSO3(Eigen::Matrix3d(to.R * from.R.transpose()));
  return motion;
}

Pose moved(const Pose& T_O_C, const Vector6& motion, const FieldMetadata& object) {
  Pose T_C_O = T_O_C.inverse();
  const Eigen::Vector3d centre_C = T_C_O * object.centre + motion.head<3>();
  T_C_O.R = nearestRotation(expSO3(Eigen::Vector3d(motion.tail<3>())) * T_C_O.R);
  T_C_O.t = centre_C - T_C_O.R * object.centre;
  return T_C_O.inverse();
}

Vector6 limited(const Vector6& motion, double most_linear, double most_angular) {
  Vector6 within = motion;
  const double linear = motion.head<3>().norm(), angular = motion.tail<3>().norm();
  if (linear > most_linear) within.head<3>() *= most_linear / linear;
  if (angular > most_angular) within.tail<3>() *= most_angular / angular;
  return within;
}

/// Takes the turn about an axis of symmetry out of motions before the camera.
Matrix6 seenMotion(const Pose& T_O_C, const FieldMetadata& object) {
  const std::optional<SymmetryAxis>& axis = object.symmetries.axis();
  Matrix6 seen = Matrix6::Identity();
  if (!axis) return seen;
  const Eigen::Matrix3d R_C_O = T_O_C.R.transpose();
  const Eigen::Vector3d direction = R_C_O * axis->direction;
  const Eigen::Vector3d arm = R_C_O * (object.centre - axis->point);
  Vector6 turn;
  turn << direction.cross(arm), direction;
  seen.rightCols<3>() -= turn * direction.transpose();
  return seen;
}

bool isJerk(const Vector6& innovation, const Matrix6& covariance) {
  constexpr double kMost = 9 * 3;  // squared distance in three degrees of freedom
  for (const int block : {0, 3}) {
    const Eigen::Vector3d part = innovation.segment<3>(block);
    const Eigen::Matrix3d variance = covariance.block<3, 3>(block, block);
    if (!(part.dot(variance.ldlt().solve(part)) <= kMost)) return true;
  }
  return false;
}

}  // namespace

/// By the object's motion, and by the camera's turn, which moves what it sees sideways.
Matrix6 MotionFilter::varianceOf(double linear_m, double angular, const Pose& T_O_C,
                                 const FieldMetadata& object) const {
  const double linear = linear_m / object.metres_per_unit;
  const Eigen::Vector3d centre_C = T_O_C.inverse() * object.centre;
  const Eigen::Matrix3d across =
      centre_C.squaredNorm() * Eigen::Matrix3d::Identity() - centre_C * centre_C.transpose();
  Matrix6 variance = Matrix6::Zero();
  variance.topLeftCorner<3, 3>() =
      linear * linear * Eigen::Matrix3d::Identity() + angular * angular * across;
  variance.bottomRightCorner<3, 3>() = angular * angular * Eigen::Matrix3d::Identity();
  return variance;
}

std::optional<std::int64_t> MotionFilter::stampNs() const {
  if (!now_) return std::nullopt;
  return stamp_ns_;
}

MotionFilter::State MotionFilter::at(const Pose& T_O_C, const Matrix6& of_twist,
                                     const FieldMetadata& object) const {
  State state;
  state.T_O_C = T_O_C;
  state.covariance.topLeftCorner<6, 6>() = alongCamera(of_twist, T_O_C);
  state.covariance.bottomRightCorner<6, 6>() =
      varianceOf(deviations_.speed, deviations_.angular_speed, T_O_C, object);
  return state;
}

void MotionFilter::start(const Prior& prior, std::int64_t stamp_ns, const FieldMetadata& object) {
  Vector6 deviation;
  deviation << Eigen::Vector3d::Constant(0.5 * prior.translation * object.diameter),
      Eigen::Vector3d::Constant(0.5 * prior.rotation_rad);
  reset();
  now_ = at(prior.T_O_C, deviation.cwiseAbs2().asDiagonal(), object);
  stamp_ns_ = stamp_ns;
}

void MotionFilter::forgetVelocity(const FieldMetadata& object) {
  if (!now_) return;
  const Matrix6 of_pose = now_->covariance.topLeftCorner<6, 6>();
  *now_ = at(now_->T_O_C, Matrix6::Zero(), object);
  now_->covariance.topLeftCorner<6, 6>() = of_pose;
}

Prior MotionFilter::predict(const Prior& last, const Eigen::Matrix3d& R_now_last, double seconds,
                            const FieldMetadata& object) {
  expected_.reset();
  fused_.reset();
  if (!now_) return last;
  seconds_ = std::max(0.0, seconds);
  before_T_O_C_ = last.T_O_C;
  const double t = seconds_;
  State next = *now_;
  const Matrix6 axes = rotationOfTwists(R_now_last);
  next.velocity = axes * now_->velocity;
  const Vector6 motion = t * next.velocity;
  next.T_O_C = moved(last.T_O_C, motion, object);

  Matrix12 step = Matrix12::Zero();
  step.topLeftCorner<6, 6>() = step.bottomRightCorner<6, 6>() = axes;
  step.topRightCorner<6, 6>() = t * axes;
  // An error of the rotation turns with the object.
  step.block<3, 3>(3, 3) = expSO3(Eigen::Vector3d(motion.tail<3>())) * R_now_last;
  const Matrix6 white =
      varianceOf(deviations_.speed_change, deviations_.angular_speed_change, last.T_O_C, object);
  next.covariance = step * now_->covariance * step.transpose();
  next.covariance.topLeftCorner<6, 6>() += t * t * t / 3 * white;
  next.covariance.topRightCorner<6, 6>() += t * t / 2 * white;
  next.covariance.bottomLeftCorner<6, 6>() += t * t / 2 * white;
  next.covariance.bottomRightCorner<6, 6>() += t * white;
  expected_ = next;

  Prior expected = last;
  const Vector6 within = limited(motion, last.translation * object.diameter, last.rotation_rad);
  expected.T_O_C = moved(last.T_O_C, within, object);
  return expected;
}

/// What a jerk makes of the velocity: that since the last image, if the object was found there.
Vector6 MotionFilter::velocityOfJerk(const State& before, const Pose& found_T_O_C,
                                     const FieldMetadata& object) const {
  constexpr double kMost = 3;  // deviations
  if (!before.was_found || !(seconds_ > 0)) return Vector6::Zero();
  const Vector6 velocity = motionBetween(before_T_O_C_, found_T_O_C, object) / seconds_;
  return limited(velocity, kMost * deviations_.speed / object.metres_per_unit,
                 kMost * deviations_.angular_speed);
}

Pose MotionFilter::fuse(const Pose& found_T_O_C, const Matrix6& of_twist,
                        const FieldMetadata& object) {
  fused_.reset();
  if (!of_twist.allFinite()) return found_T_O_C;
  State fused = at(found_T_O_C, of_twist, object);
  fused.was_found = true;
  if (expected_) {
    const Vector6 innovation = motionBetween(expected_->T_O_C, found_T_O_C, object);
    const Matrix6 noise = alongCamera(of_twist, found_T_O_C);
    const Matrix6 sum = expected_->covariance.topLeftCorner<6, 6>() + noise;
    const Eigen::LDLT<Matrix6> solver(sum);
    if (solver.info() != Eigen::Success || isJerk(innovation, sum)) {
      fused.velocity = velocityOfJerk(*expected_, found_T_O_C, object);
    } else {
      using Gain = Eigen::Matrix<double, 12, 6>;
      const Matrix12& before = expected_->covariance;
      const Gain gain = solver.solve(before.topRows<6>()).transpose();
      Matrix12 kept = Matrix12::Identity();  // in Joseph's form, which stays positive
      kept.leftCols<6>() -= gain;
      const Matrix6 seen = seenMotion(found_T_O_C, object);
      Matrix12 both = Matrix12::Zero();
      both.topLeftCorner<6, 6>() = both.bottomRightCorner<6, 6>() = seen;
      kept = both * kept;
      const Gain gain_seen = both * gain;
      fused.covariance =
          kept * before * kept.transpose() + gain_seen * noise * gain_seen.transpose();
      const Eigen::Matrix<double, 12, 1> correction = gain_seen * innovation;
      fused.velocity = seen * (expected_->velocity + correction.tail<6>());
      fused.T_O_C = moved(expected_->T_O_C, correction.head<6>(), object);
    }
  }
  fused_ = fused;
  return fused.T_O_C;
}

void MotionFilter::accept(std::int64_t stamp_ns) {
  if (!fused_) return reset();
  now_ = std::exchange(fused_, std::nullopt);
  expected_.reset();
  stamp_ns_ = stamp_ns;
}

}  // namespace nerf_pose_refiner
