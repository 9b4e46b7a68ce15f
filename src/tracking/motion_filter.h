// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>

#include "field/field.h"
#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {

/// How objects and cameras move: standard deviations along each axis. The defaults are those of a
/// robot's arm or of a hand.
struct MotionDeviations {
  double speed_change = 0.25;         ///< of the object's centre in a second [m/s]
  double angular_speed_change = 2.5;  ///< of the object or the camera in a second [rad/s]
  double speed = 0.5;                 ///< while nothing is known of it [m/s]
  double angular_speed = 3;           ///< while nothing is known of it [rad/s]
};

/// A Kalman filter of an object's pose and velocity before a camera: where the object is expected
/// in the next image, and how much that counts beside what the image shows. Most directions are
/// seen far better than they can be predicted; the distance of a small object is not.
///
/// The object's centre and the rotation about it keep their velocity, but for white noise of the
/// acceleration (Bar-Shalom, Li and Kirubarajan, Estimation with Applications to Tracking and
/// Navigation, 2001, 6.2.2). Vectors are along the axes of the camera, in model units, radians and
/// seconds. Turns about an axis of symmetry, which no image shows, are neither continued nor
/// estimated.
class MotionFilter {
 public:
  explicit MotionFilter(const MotionDeviations& deviations = {}) : deviations_(deviations) {}

  /// Nothing is known of the object.
  void reset() { *this = MotionFilter(deviations_); }

  /// The stamp of the pose that the filter is at; nothing: of none.
  std::optional<std::int64_t> stampNs() const;

  /// Somebody says that the object is at a pose, as far as the half widths of a prior say: they are
  /// two standard deviations. Nothing is known of its velocity. @pre object.metres_per_unit > 0
  void start(const Prior& prior, std::int64_t stamp_ns, const FieldMetadata& object);

  /// Nothing is known of the object's velocity any more.
  void forgetVelocity(const FieldMetadata& object);

  /// Where the object is expected. The state stays as it is until `accept`.
  ///
  /// The motion is at most the half width of the search, so that an object that stops is still
  /// found.
  /// @param last prior around the last pose, for the camera at its present place.
  /// @param R_now_last rotation from the camera's axes in the last image to those of the present.
  /// @param seconds since then; less than 0 counts as 0.
  Prior predict(const Prior& last, const Eigen::Matrix3d& R_now_last, double seconds,
                const FieldMetadata& object);

  /// Fuses where the object was found with where it was expected by the last `predict`. A motion
  /// that no such object makes is a jerk: the pose found counts alone.
  /// @param of_twist covariance of the pose found, @see Refinement::covariance.
  /// @return the pose to go on from. The state stays as it is until `accept`.
  Pose fuse(const Pose& found_T_O_C, const Matrix6& of_twist, const FieldMetadata& object);

  /// The track goes on from the pose that was fused last. @param stamp_ns of its image.
  void accept(std::int64_t stamp_ns);

 private:
  using Matrix12 = Eigen::Matrix<double, 12, 12>;

  struct State {
    Pose T_O_C;
    Vector6 velocity = Vector6::Zero();      // of the centre; rotation vector a second
    Matrix12 covariance = Matrix12::Zero();  // of the pose, then of the velocity
    bool was_found = false;                  // in an image, so that a motion from there is one
  };

  State at(const Pose& T_O_C, const Matrix6& of_twist, const FieldMetadata& object) const;
  Matrix6 varianceOf(double linear_m, double angular, const Pose& T_O_C,
                     const FieldMetadata& object) const;
  Vector6 velocityOfJerk(const State& before, const Pose& found_T_O_C,
                         const FieldMetadata& object) const;

  MotionDeviations deviations_;
  std::optional<State> now_;       // nothing: nobody has said where the object is
  std::int64_t stamp_ns_ = 0;      // of now_
  std::optional<State> expected_;  // where the last prediction led, however wide the search was
  Pose before_T_O_C_;              // now_, for the camera at its place of the last prediction
  double seconds_ = 0;             // from now_ to expected_
  std::optional<State> fused_;     // to be accepted
};

}  // namespace nerf_pose_refiner
