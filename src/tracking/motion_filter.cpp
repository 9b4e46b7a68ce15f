// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tracking/motion_filter.h"

#include <Eigen/Cholesky>

#include <algorithm>

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

Eigen::Vector3d limited(const Eigen::Vector3d& v, double most) {
  return v.norm() > most ? Eigen::Vector3d(most / v.norm() * v) : v;
}

}  // namespace

Matrix6 MotionFilter::deviating(double linear_m, double angular,
                                const FieldMetadata& object) const {
  const double linear = linear_m / object.metres_per_unit;
  Vector6 variances;
  variances.head<3>().setConstant(linear * linear);
  variances.tail<3>().setConstant(angular * angular);
  return variances.asDiagonal();
}

void MotionFilter::start(const Pose& T_O_C, const Matrix6& of_twist, const FieldMetadata& object) {
  now_.emplace();
  now_->covariance.topLeftCorner<6, 6>() = alongCamera(of_twist, T_O_C);
  forgetVelocity(object);
}

void MotionFilter::forgetVelocity(const FieldMetadata& object) {
  if (!now_) return;
  const Matrix6 of_pose = now_->covariance.topLeftCorner<6, 6>();
  *now_ = State();
  now_->covariance.topLeftCorner<6, 6>() = of_pose;
  now_->covariance.bottomRightCorner<6, 6>() =
      deviating(deviations_.speed, deviations_.angular_speed, object);
}

Prior MotionFilter::predict(const Prior& last, const Eigen::Matrix3d& turn, double seconds,
                            const FieldMetadata& object) {
  expected_.reset();
  if (!now_) return last;
  seconds_ = std::max(0.0, seconds);
  const Matrix6 axes = rotationOfTwists(turn);
  Matrix12 step = Matrix12::Zero();
  step.topLeftCorner<6, 6>() = step.bottomRightCorner<6, 6>() = axes;
  step.topRightCorner<6, 6>() = seconds_ * axes;
  const double by_speed = seconds_, by_place = seconds_ * seconds_ / 2;
  const Matrix6 acceleration =
      deviating(deviations_.acceleration, deviations_.angular_acceleration, object);
  expected_.emplace();
  expected_->velocity = axes * now_->velocity;
  Matrix12& covariance = expected_->covariance;
  covariance = step * now_->covariance * step.transpose();
  covariance.topLeftCorner<6, 6>() += by_place * by_place * acceleration;
  covariance.topRightCorner<6, 6>() += by_place * by_speed * acceleration;
  covariance.bottomLeftCorner<6, 6>() += by_place * by_speed * acceleration;
  covariance.bottomRightCorner<6, 6>() += by_speed * by_speed * acceleration;

  const Vector6 motion = seconds_ * expected_->velocity;
  Vector6 within;
  within << limited(motion.head<3>(), last.translation * object.diameter),
      limited(motion.tail<3>(), last.rotation_rad);
  Prior expected = last;
  expected.T_O_C = moved(last.T_O_C, within, object);
  return expected;
}

Pose MotionFilter::update(const Pose& expected_T_O_C, const Pose& found_T_O_C,
                          const Matrix6& of_twist, const FieldMetadata& object) {
  constexpr double kJerk = 9;  // squared normalised innovation, a degree of freedom
  if (!expected_) {
    start(found_T_O_C, of_twist, object);
    return found_T_O_C;
  }
  const Vector6 innovation = motionBetween(expected_T_O_C, found_T_O_C, object);
  const Matrix12 covariance = expected_->covariance;
  const Matrix6 noise = alongCamera(of_twist, found_T_O_C);
  const Eigen::LDLT<Matrix6> sum(Matrix6(covariance.topLeftCorner<6, 6>() + noise));
  if (innovation.dot(sum.solve(innovation)) > kJerk * 6) {
    const Vector6 before = expected_->velocity;
    start(found_T_O_C, of_twist, object);
    if (seconds_ > 0) now_->velocity = before + innovation / seconds_;
    return found_T_O_C;
  }
  using Gain = Eigen::Matrix<double, 12, 6>;
  const Gain of_pose = covariance.leftCols<6>();
  const Gain gain = sum.solve(of_pose.transpose()).transpose();
  now_ = *expected_;
  now_->velocity += gain.bottomRows<6>() * innovation;
  now_->covariance -= gain * of_pose.transpose();
  now_->covariance = (0.5 * (now_->covariance + now_->covariance.transpose())).eval();
  return moved(expected_T_O_C, Vector6(gain.topRows<6>() * innovation), object);
}

}  // namespace nerf_pose_refiner
