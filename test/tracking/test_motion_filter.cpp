// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>

#include "math/angle.h"
#include "tracking/motion_filter.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kSeconds = 0.1;  // between images
const Eigen::Matrix3d kSameAxes = Eigen::Matrix3d::Identity();

/// An object whose centre is not the origin of its frame, which turns about it and goes to the
/// right before a camera that looks at it.
class MotionFilterTest : public testing::Test {
 protected:
  MotionFilterTest() {
    object_.centre = {0.3, -0.2, 0.1};
    object_.diameter = 2;
    object_.metres_per_unit = 0.5;
    width_.rotation_rad = 5 * kDegree;
    width_.translation = 0.05;  // 0.1 units
  }

  /// 40 degrees and 0.6 units a second.
  Pose cameraAt(double seconds, double depth = 3) const {
    Pose T_C_O;
    T_C_O.R = expSO3({0, 0, 40 * kDegree * seconds}) * expSO3({1, 0.5, 0});
    T_C_O.t = Eigen::Vector3d(0.6 * seconds, 0, depth) - T_C_O.R * object_.centre;
    return T_C_O.inverse();
  }

  Prior around(const Pose& T_O_C) const {
    Prior prior = width_;
    prior.T_O_C = T_O_C;
    return prior;
  }

  /// Of a camera's twist in O: the same along each axis.
  static Matrix6 covarianceOf(double position, double rotation_rad) {
    Vector6 deviation;
    deviation << Eigen::Vector3d::Constant(position), Eigen::Vector3d::Constant(rotation_rad);
    return deviation.cwiseAbs2().asDiagonal();
  }

  /// Without accelerations.
  static MotionDeviations steady() {
    MotionDeviations deviations;
    deviations.acceleration = deviations.angular_acceleration = 1e-6;
    return deviations;
  }

  /// One image further. @return where the track goes on from.
  Pose next(MotionFilter* filter, const Pose& last, const Pose& found, const Matrix6& covariance) {
    const Prior expected = filter->predict(around(last), kSameAxes, kSeconds, object_);
    return filter->update(expected.T_O_C, found, covariance, object_);
  }

  Eigen::Vector3d centreIn(const Pose& T_O_C) const { return T_O_C.inverse() * object_.centre; }

  static void expectNear(const Pose& found, const Pose& truth, double bound) {
    EXPECT_LT((found.R - truth.R).norm(), bound);
    EXPECT_LT((found.t - truth.t).norm(), bound);
  }

  FieldMetadata object_;
  Prior width_;
};

TEST_F(MotionFilterTest, ExpectsTheLastPoseWhereNothingIsKnown) {
  MotionFilter filter;
  expectNear(filter.predict(around(cameraAt(1)), kSameAxes, 1, object_).T_O_C, cameraAt(1), 1e-12);
  expectNear(filter.update(cameraAt(0), cameraAt(1), covarianceOf(1, 1), object_), cameraAt(1),
             1e-12);
}

TEST_F(MotionFilterTest, GoesOnWithTheVelocityOfExactPoses) {
  MotionFilter filter(steady());
  const Matrix6 exact = covarianceOf(1e-6, 1e-6);
  filter.start(cameraAt(0), exact, object_);
  Pose last = next(&filter, cameraAt(0), cameraAt(0.1), exact);
  expectNear(last, cameraAt(0.1), 1e-6);
  for (const double ahead : {0.1, 0.05, 0.0}) {
    const Prior expected = filter.predict(around(last), kSameAxes, ahead, object_);
    expectNear(expected.T_O_C, cameraAt(0.1 + ahead), 1e-5);
    EXPECT_TRUE(expected.isAsWideAs(width_));
  }
  expectNear(filter.predict(around(last), kSameAxes, -1, object_).T_O_C, last, 1e-12);
}

TEST_F(MotionFilterTest, ForgetsTheVelocity) {
  MotionFilter filter;
  const Matrix6 exact = covarianceOf(1e-6, 1e-6);
  filter.start(cameraAt(0), exact, object_);
  const Pose last = next(&filter, cameraAt(0), cameraAt(0.1), exact);
  filter.forgetVelocity(object_);
  expectNear(filter.predict(around(last), kSameAxes, kSeconds, object_).T_O_C, last, 1e-12);
}

TEST_F(MotionFilterTest, GoesNoFartherThanTheSearchIsWide) {
  MotionFilter filter;
  const Matrix6 exact = covarianceOf(1e-6, 1e-6);
  filter.start(cameraAt(0), exact, object_);
  const Pose last = next(&filter, cameraAt(0), cameraAt(0.1), exact);
  const Pose expected = filter.predict(around(last), kSameAxes, 1, object_).T_O_C;
  EXPECT_NEAR(rotationDistance(expected.R, last.R), 5 * kDegree, 1e-9) << "not by 40 degrees";
  EXPECT_NEAR((centreIn(expected) - centreIn(last)).norm(), 0.1, 1e-9) << "not by 0.6 units";
}

// Along one axis, by hand: deviations of the place 0.03, of the speed 0.4, of the acceleration 2,
// in units of the model. In 0.1 s the place's variance is 0.0009 + 0.0016 + 0.0001 = 0.0026. The
// place found has that of 0.0026, too: half of the way.
TEST_F(MotionFilterTest, WeighsTheExpectedPoseWithTheOneFound) {
  MotionDeviations deviations;
  deviations.speed = 0.2;  // 0.4 units
  deviations.acceleration = 1;
  MotionFilter filter(deviations);
  const Pose start = cameraAt(0, 3);
  filter.start(start, covarianceOf(0.03, 1e-4), object_);
  const Pose last = next(&filter, start, cameraAt(0, 3.06), covarianceOf(std::sqrt(0.0026), 1e-4));
  EXPECT_NEAR(centreIn(last).z(), 3.03, 1e-6);
  // The speed's covariance with the place is 0.1 * 0.16 + 0.005 * 0.1 * 4 = 0.018, so its share of
  // the 0.06 units is 0.018 / 0.0052, and it moves on by a tenth of that in the next 0.1 s.
  const Pose expected = filter.predict(around(last), kSameAxes, kSeconds, object_).T_O_C;
  EXPECT_NEAR(centreIn(expected).z(), 3.03 + 0.1 * 0.06 * 0.018 / 0.0052, 1e-6);
}

TEST_F(MotionFilterTest, CalmsWhatImagesHardlyShow) {
  MotionFilter filter;
  // Along the view alone: its axis in O.
  const Eigen::Vector3d view = cameraAt(0).R.col(2);
  Matrix6 noise = covarianceOf(1e-3, 1e-3);
  noise.topLeftCorner<3, 3>() += 0.09 * view * view.transpose();
  const Pose truth = cameraAt(0);
  Pose last = truth;
  filter.start(last, noise, object_);
  double squared = 0;
  const int count = 60;
  for (int i = 0; i < count; ++i) {
    const Pose found = cameraAt(0, 3 + (i % 2 == 0 ? 0.3 : -0.3));
    last = next(&filter, last, found, noise);
    squared += std::pow(centreIn(last).z() - 3, 2) / count;
    EXPECT_NEAR(centreIn(last).x(), 0, 1e-6);
  }
  EXPECT_LT(std::sqrt(squared), 0.15) << "half of the poses that were found";
}

TEST_F(MotionFilterTest, FollowsAJerkAtOnce) {
  MotionFilter filter;
  const Matrix6 exact = covarianceOf(1e-3, 1e-3);
  Pose last = cameraAt(0);
  filter.start(last, exact, object_);
  for (int i = 0; i < 5; ++i) last = next(&filter, last, cameraAt(0), exact);
  last = next(&filter, last, cameraAt(0, 3.5), exact);  // 5 units a second
  expectNear(last, cameraAt(0, 3.5), 1e-12);
  const Pose expected = filter.predict(around(last), kSameAxes, 0.01, object_).T_O_C;
  EXPECT_NEAR(centreIn(expected).z(), 3.55, 0.002) << "and goes on with it";
}

// A camera that turns about its own axis sees the same motion along other axes.
TEST_F(MotionFilterTest, TurnsTheMotionWithTheCamerasAxes) {
  MotionFilter filter(steady());
  const Matrix6 exact = covarianceOf(1e-6, 1e-6);
  filter.start(cameraAt(0), exact, object_);
  const Pose last = next(&filter, cameraAt(0), cameraAt(0.1), exact);
  const Pose turn = {expSO3({0, 0, 1}), Eigen::Vector3d::Zero()};  // from the old axes to the new
  const Pose expected =
      filter.predict(around(last * turn.inverse()), turn.R, kSeconds, object_).T_O_C;
  expectNear(expected, cameraAt(0.2) * turn.inverse(), 1e-5);
}

// A bottle's turn about its axis is nothing that an image shows.
TEST_F(MotionFilterTest, DoesNotSpinWhatLooksTheSame) {
  MotionFilter filter;
  SymmetryAxis axis;
  axis.direction = {0, 1, 0};
  axis.point = object_.centre;
  object_.symmetries = Symmetries(axis, {});
  const Matrix6 free = freeAbout(axis, covarianceOf(1e-3, 1e-3), object_.centre);
  Pose last = cameraAt(0);
  filter.start(last, free, object_);
  for (int i = 0; i < 1000; ++i) {
    // (An image's pose is the equivalent one that is nearest to the prior.)
    const Prior expected = filter.predict(around(last), kSameAxes, kSeconds, object_);
    last = filter.update(expected.T_O_C, expected.T_O_C, free, object_);
  }
  expectNear(last, cameraAt(0), 1e-6);
}

}  // namespace
}  // namespace nerf_pose_refiner
