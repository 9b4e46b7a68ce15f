// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <optional>

#include "field/field.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// How objects move before cameras: standard deviations along each axis. The defaults are those of
/// a robot's arm or of a hand.
struct MotionDeviations {
  double acceleration = 1;           ///< white, of the object's centre [m/s^2]
  double angular_acceleration = 10;  ///< alike [rad/s^2]
  double speed = 0.5;                ///< while nothing is known of it [m/s]
  double angular_speed = 3;          ///< alike [rad/s]
};

/// A Kalman filter of an object's pose and velocity before a camera: where the object is expected
/// in the next image, and how much that counts beside what the image shows. Most directions are
/// seen far better than they can be predicted; the distance of a small object is not.
///
/// The object's centre and the rotation about it keep their velocity, but for white accelerations
/// (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and Navigation, 2001,
/// 6.3.2). Vectors are along the axes of the camera, in model units, radians and seconds.
class MotionFilter {
 public:
  explicit MotionFilter(const MotionDeviations& deviations = {}) : deviations_(deviations) {}

  /// Nothing is known of the object.
  void reset() {
    now_.reset();
    expected_.reset();
  }

  /// The object is at a pose, as far as a covariance says. Nothing is known of its velocity.
  /// @param of_twist @see Refinement::covariance. @pre object.metres_per_unit > 0
  void start(const Pose& T_O_C, const Matrix6& of_twist, const FieldMetadata& object);

  /// Nothing is known of the object's velocity any more.
  void forgetVelocity(const FieldMetadata& object);

  /// Where the object is expected. The state stays as it is until `update`.
  ///
  /// The motion is at most the half width of the search, so that an object that stops is still
  /// found.
  /// @param last prior around the last pose, for the camera at its present place. @param turn what
  /// was v along the camera's axes in the last image is turn * v now. @param seconds since then;
  /// less than 0 counts as 0.
  Prior predict(const Prior& last, const Eigen::Matrix3d& turn, double seconds,
                const FieldMetadata& object);

  /// Joins where the object was found with where it was expected. A motion that no such object
  /// makes is a jerk, and begins the filter anew.
  /// @param expected what `predict` gave for this image. @param of_twist covariance of `found`.
  /// @return the pose to go on from.
  Pose update(const Pose& expected_T_O_C, const Pose& found_T_O_C, const Matrix6& of_twist,
              const FieldMetadata& object);

 private:
  using Matrix12 = Eigen::Matrix<double, 12, 12>;

  struct State {
    Vector6 velocity = Vector6::Zero();      // of the centre; rotation vector a second
    Matrix12 covariance = Matrix12::Zero();  // of the pose, then of the velocity
  };

  Matrix6 deviating(double linear_m, double angular, const FieldMetadata& object) const;

  MotionDeviations deviations_;
  std::optional<State> now_;       // nothing: the object has not been found yet
  std::optional<State> expected_;  // in the image that was predicted last
  double seconds_ = 0;             // from now_ to expected_
};

}  // namespace nerf_pose_refiner
