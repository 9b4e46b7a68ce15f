// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "math/angle.h"
#include "nerf_pose_refiner/symmetry.h"
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
    deviations.speed_change = deviations.angular_speed_change = 1e-6;
    return deviations;
  }

  /// One image further. @return where the track goes on from.
  Pose next(MotionFilter* filter, const Pose& last, const Pose& found, const Matrix6& covariance,
            double seconds = kSeconds) {
    filter->predict(around(last), kSameAxes, seconds, object_);
    const Pose fused = filter->fuse(found, covariance, object_);
    filter->accept(++images_);
    return fused;
  }

  /// A filter that has found the object at some time. @param covariance of that.
  MotionFilter startedAt(double seconds, const Matrix6& covariance,
                         const MotionDeviations& deviations = {}) {
    MotionFilter filter(deviations);
    next(&filter, cameraAt(seconds), cameraAt(seconds), covariance);
    return filter;
  }

  Eigen::Vector3d centreIn(const Pose& T_O_C) const { return T_O_C.inverse() * object_.centre; }

  static void expectNear(const Pose& found, const Pose& truth, double bound) {
    EXPECT_LT((found.R - truth.R).norm(), bound);
    EXPECT_LT((found.t - truth.t).norm(), bound);
  }

  FieldMetadata object_;
  Prior width_;
  std::int64_t images_ = 0;
};

TEST_F(MotionFilterTest, ExpectsTheLastPoseWhereNothingIsKnown) {
  MotionFilter filter;
  EXPECT_FALSE(filter.stampNs());
  expectNear(filter.predict(around(cameraAt(1)), kSameAxes, 1, object_).T_O_C, cameraAt(1), 1e-12);
  expectNear(filter.fuse(cameraAt(1), covarianceOf(1, 1), object_), cameraAt(1), 1e-12);
  EXPECT_FALSE(filter.stampNs()) << "nothing was accepted yet";
  filter.accept(7);
  EXPECT_EQ(*filter.stampNs(), 7);
}

TEST_F(MotionFilterTest, GoesOnWithTheVelocityOfExactPoses) {
  const Matrix6 exact = covarianceOf(1e-6, 1e-6);
  MotionFilter filter = startedAt(0, exact, steady());
  const Pose last = next(&filter, cameraAt(0), cameraAt(0.1), exact);
  expectNear(last, cameraAt(0.1), 1e-6);
  for (const double ahead : {0.1, 0.05, 0.0}) {
    const Prior expected = filter.predict(around(last), kSameAxes, ahead, object_);
    expectNear(expected.T_O_C, cameraAt(0.1 + ahead), 1e-5);
    EXPECT_TRUE(expected.isAsWideAs(width_));
  }
  expectNear(filter.predict(around(last), kSameAxes, -1, object_).T_O_C, last, 1e-12);
}

TEST_F(MotionFilterTest, AnImageThatIsNotAcceptedLeavesNoTrace) {
  const Matrix6 exact = covarianceOf(1e-6, 1e-6);
  MotionFilter filter = startedAt(0, exact, steady());
  filter.predict(around(cameraAt(0)), kSameAxes, kSeconds, object_);
  filter.fuse(cameraAt(0.1), exact, object_);
  EXPECT_EQ(*filter.stampNs(), 1);
  expectNear(filter.predict(around(cameraAt(0)), kSameAxes, 0.2, object_).T_O_C, cameraAt(0),
             1e-12);
}

TEST_F(MotionFilterTest, ForgetsTheVelocity) {
  const Matrix6 exact = covarianceOf(1e-6, 1e-6);
  MotionFilter filter = startedAt(0, exact);
  const Pose last = next(&filter, cameraAt(0), cameraAt(0.1), exact);
  filter.forgetVelocity(object_);
  expectNear(filter.predict(around(last), kSameAxes, kSeconds, object_).T_O_C, last, 1e-12);
}

TEST_F(MotionFilterTest, GoesNoFartherThanTheSearchIsWide) {
  const Matrix6 exact = covarianceOf(1e-6, 1e-6);
  MotionFilter filter = startedAt(0, exact);
  const Pose last = next(&filter, cameraAt(0), cameraAt(0.1), exact);
  const Pose expected = filter.predict(around(last), kSameAxes, 1, object_).T_O_C;
  EXPECT_NEAR(rotationDistance(expected.R, last.R), 5 * kDegree, 1e-9) << "not by 40 degrees";
  EXPECT_NEAR((centreIn(expected) - centreIn(last)).norm(), 0.1, 1e-9) << "not by 0.6 units";
}

// 8 degrees and 0.12 units an image, more than the search is wide, and then it stops.
TEST_F(MotionFilterTest, ANarrowSearchDoesNotMakeItFaster) {
  const Matrix6 noise = covarianceOf(1e-3, 1e-3);
  MotionFilter filter = startedAt(0, noise);
  Pose last = cameraAt(0);
  double now = 0;
  for (int i = 0; i < 50; ++i) {
    now += 2 * kSeconds;
    last = next(&filter, last, cameraAt(now), noise, 2 * kSeconds);
    expectNear(last, cameraAt(now), 2e-3);
  }
  Prior wide = around(last);
  wide.rotation_rad = 1;
  wide.translation = 1;
  expectNear(filter.predict(wide, kSameAxes, kSeconds, object_).T_O_C, cameraAt(now + 0.1), 2e-3);
  for (int i = 0; i < 3; ++i) last = next(&filter, last, cameraAt(now), noise);
  expectNear(last, cameraAt(now), 2e-3);
  wide.T_O_C = last;
  expectNear(filter.predict(wide, kSameAxes, kSeconds, object_).T_O_C, cameraAt(now), 0.03);
}

// Along one axis, by hand: variances of the place 0.0009, of the speed 0.16, of its change in a
// second 0.3, in units of the model. In 0.1 s the place's is 0.0009 + 0.0016 + 0.0003 / 3 = 0.0026.
// The place found has that of 0.0026, too: half of the way.
TEST_F(MotionFilterTest, WeighsTheExpectedPoseWithTheOneFound) {
  MotionDeviations deviations;
  deviations.speed = 0.2;  // 0.4 units
  deviations.speed_change = 0.5 * std::sqrt(0.3);
  deviations.angular_speed_change = 1e-6;  // of the camera
  deviations.angular_speed = 1e-6;
  const Pose start = cameraAt(0, 3);
  MotionFilter filter = startedAt(0, covarianceOf(0.03, 1e-4), deviations);
  const Pose last = next(&filter, start, cameraAt(0, 3.06), covarianceOf(std::sqrt(0.0026), 1e-4));
  EXPECT_NEAR(centreIn(last).z(), 3.03, 1e-6);
  // The speed's covariance with the place is 0.1 * 0.16 + 0.01 / 2 * 0.3 = 0.0175, so its share of
  // the 0.06 units is 0.0175 / 0.0052, and it moves on by a tenth of that in the next 0.1 s.
  const Pose expected = filter.predict(around(last), kSameAxes, kSeconds, object_).T_O_C;
  EXPECT_NEAR(centreIn(expected).z(), 3.03 + 0.1 * 0.06 * 0.0175 / 0.0052, 1e-6);
}

// Half widths of 0.1 units are deviations of 0.05; the pose found is as uncertain.
TEST_F(MotionFilterTest, AHintCountsByItsWidth) {
  MotionFilter filter;
  filter.start(around(cameraAt(0, 3)), 3, object_);
  EXPECT_EQ(*filter.stampNs(), 3);
  const Pose last = next(&filter, cameraAt(0, 3), cameraAt(0, 3.04), covarianceOf(0.05, 1e-4), 0);
  EXPECT_NEAR(centreIn(last).z(), 3.02, 1e-6);
}

TEST_F(MotionFilterTest, CalmsWhatImagesHardlyShow) {
  // Along the view alone: its axis in O.
  const Eigen::Vector3d view = cameraAt(0).R.col(2);
  Matrix6 noise = covarianceOf(1e-3, 1e-3);
  noise.topLeftCorner<3, 3>() += 0.09 * view * view.transpose();
  MotionFilter filter = startedAt(0, noise);
  Pose last = cameraAt(0);
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
  const Matrix6 exact = covarianceOf(1e-3, 1e-3);
  MotionFilter filter = startedAt(0, exact);
  Pose last = cameraAt(0);
  for (int i = 0; i < 5; ++i) last = next(&filter, last, cameraAt(0), exact);
  last = next(&filter, last, cameraAt(0, 3.25), exact);  // 2.5 units a second
  expectNear(last, cameraAt(0, 3.25), 1e-12);
  const Pose expected = filter.predict(around(last), kSameAxes, 0.02, object_).T_O_C;
  EXPECT_NEAR(centreIn(expected).z(), 3.3, 1e-6) << "and goes on with it";
  filter.predict(around(last), kSameAxes, kSeconds, object_);
  filter.fuse(cameraAt(0, 8), exact, object_);  // it was mistaken for something far away
  filter.accept(99);
  const Pose after = filter.predict(around(cameraAt(0, 8)), kSameAxes, 0.01, object_).T_O_C;
  EXPECT_NEAR(centreIn(after).z(), 8.03, 1e-6) << "no faster than three deviations";
}

TEST_F(MotionFilterTest, AWrongHintIsNoMotion) {
  MotionFilter filter;
  filter.start(around(cameraAt(0, 3)), 1, object_);
  const Pose last = next(&filter, cameraAt(0, 3), cameraAt(0, 4), covarianceOf(1e-3, 1e-3));
  expectNear(last, cameraAt(0, 4), 1e-12);
  expectNear(filter.predict(around(last), kSameAxes, kSeconds, object_).T_O_C, last, 1e-12);
}

// A camera that turns about its own axis sees the same motion along other axes.
TEST_F(MotionFilterTest, TurnsTheMotionWithTheCamerasAxes) {
  const Matrix6 exact = covarianceOf(1e-6, 1e-6);
  MotionFilter filter = startedAt(0, exact, steady());
  const Pose last = next(&filter, cameraAt(0), cameraAt(0.1), exact);
  const Pose turn = {expSO3({0, 0, 1}), Eigen::Vector3d::Zero()};  // from the old axes to the new
  const Pose expected =
      filter.predict(around(last * turn.inverse()), turn.R, kSeconds, object_).T_O_C;
  expectNear(expected, cameraAt(0.2) * turn.inverse(), 1e-5);
}

// A camera that turns moves all that it sees sideways, the farther the more: no jerk, and no lag.
TEST_F(MotionFilterTest, ATurnOfTheCameraIsFollowedSideways) {
  const Matrix6 noise = covarianceOf(2e-3, 1e-3);
  MotionFilter filter = startedAt(0, noise);
  Pose last = cameraAt(0);
  for (int i = 0; i < 5; ++i) last = next(&filter, last, cameraAt(0), noise);
  const Pose turn = {expSO3({0, 0.05, 0}), Eigen::Vector3d::Zero()};
  last = next(&filter, last, cameraAt(0) * turn.inverse(), noise);
  expectNear(last, cameraAt(0) * turn.inverse(), 2e-3);
}

// A bottle's turn about its axis is nothing that an image shows, however noisy its axis is.
TEST_F(MotionFilterTest, DoesNotSpinWhatLooksTheSame) {
  SymmetryAxis axis;
  axis.direction = {0, 1, 0};
  axis.point = {0, 0.4, 0.5};
  object_.symmetries = Symmetries(axis, {});
  const Matrix6 free = freeAbout(axis, covarianceOf(5e-3, 5e-3), object_.centre);
  MotionFilter filter = startedAt(0, free);
  Pose last = cameraAt(0);
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal(0, 5e-3);
  for (int i = 0; i < 300; ++i) {
    const Prior expected = filter.predict(around(last), kSameAxes, 1 / 30.0, object_);
    const Eigen::Vector3d tilt(normal(random), normal(random), normal(random));
    Pose seen = {expSO3(tilt) * cameraAt(0).R, cameraAt(0).t};
    // An image's pose is the equivalent one that is nearest to the prior.
    seen = nearestEquivalent(seen, expected.T_O_C, object_.symmetries);
    last = filter.fuse(seen, free, object_);
    filter.accept(i);
  }
  expectNear(last, cameraAt(0), 0.05);
}

TEST_F(MotionFilterTest, PosesWithoutACovarianceAreTakenAsTheyAre) {
  MotionFilter filter = startedAt(0, covarianceOf(1e-3, 1e-3));
  filter.predict(around(cameraAt(0)), kSameAxes, kSeconds, object_);
  Matrix6 none = covarianceOf(1e-3, 1e-3);
  none(2, 2) = NAN;
  expectNear(filter.fuse(cameraAt(0.1), none, object_), cameraAt(0.1), 1e-12);
  filter.accept(2);
  EXPECT_FALSE(filter.stampNs()) << "and begin anew";
}

}  // namespace
}  // namespace nerf_pose_refiner
