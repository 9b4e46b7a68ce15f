// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/calibration.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <random>
#include <stdexcept>

#include "geometry/matrix6.h"
#include "math/angle.h"
#include "math/so3.h"

namespace nerf_pose_refiner {
namespace {

/// Three cameras around a place; errors along a view are ten times those across it.
class CalibrationTest : public testing::Test {
 protected:
  CalibrationTest() {
    for (const double deg : {0.0, 75.0, -75.0}) {
      const Eigen::Matrix3d turn = expSO3({0, deg * kDegree, 0});
      const Eigen::Vector3d middle(0, 0, 0.6);
      true_.emplace_back(turn, middle - turn * middle);
    }
    stated_ = true_;
    stated_[2].t += Eigen::Vector3d(0.003, -0.002, 0.0035);  // 5 mm
    stated_[2].R = expSO3(Eigen::Vector3d(0.3, -0.3, 0.26) * kDegree) * stated_[2].R;
    covariance_.setZero();
    covariance_.diagonal() << 4e-8, 4e-8, 4e-6, 4e-6, 4e-6, 4e-6;  // 0.2 and 2 mm, 0.11 degrees
  }

  Vector6 drawn() {
    Vector6 z;
    for (int i = 0; i < 6; ++i) z[i] = normal_(random_);
    return covariance_.llt().matrixL() * z;
  }

  /// @param spread_m of positions. @param spread_rad of rotations.
  RigSighting sighting(double spread_m, double spread_rad) {
    const auto vector = [&] {
      return Eigen::Vector3d(normal_(random_), normal_(random_), normal_(random_));
    };
    const Pose T_C_O(expSO3(Eigen::Vector3d(spread_rad * vector())),
                     Eigen::Vector3d(0, 0, 0.6) + spread_m * vector());
    RigSighting seen;
    for (const Pose& T_C_V : true_) {
      Pose pose = T_C_V.inverse() * T_C_O;
      const Vector6 error = drawn();
      pose.t += error.head<3>();
      pose.R = expSO3(Eigen::Vector3d(error.tail<3>())) * pose.R;
      seen.push_back(CameraSighting{pose, covariance_});
    }
    return seen;
  }

  std::vector<RigSighting> sightings(int count, double spread_m = 0.06, double spread_rad = 0.8) {
    std::vector<RigSighting> all;
    for (int i = 0; i < count; ++i) all.push_back(sighting(spread_m, spread_rad));
    return all;
  }

  Vector6 errorOf(const CameraCalibration& found) const {
    Vector6 error;
    error << found.T_C_V.t - true_[2].t,
        logSO3(Eigen::Matrix3d(found.T_C_V.R * true_[2].R.transpose()));
    return error;
  }

  std::mt19937_64 random_{5};
  std::normal_distribution<double> normal_;
  std::vector<Pose> true_, stated_;
  Matrix6 covariance_;
};

TEST_F(CalibrationTest, FindsACameraThatIsOff) {
  const CameraCalibration found = calibrateCamera(sightings(40), stated_, 2);
  EXPECT_TRUE(found.success) << found.message;
  EXPECT_EQ(found.sightings, 40);
  EXPECT_LT(errorOf(found).head<3>().norm(), 0.0005);
  EXPECT_LT(errorOf(found).tail<3>().norm(), 0.05 * kDegree);
  EXPECT_NEAR(found.misfit, 1, 0.2);
}

TEST_F(CalibrationTest, SaysHowFarItMayBeOff) {
  double squared = 0;
  constexpr int kTrials = 40;
  for (int i = 0; i < kTrials; ++i) {
    const CameraCalibration found = calibrateCamera(sightings(30), stated_, 2);
    const Vector6 error = errorOf(found);
    squared += squaredDistance(error, found.covariance) / 6;
  }
  // Errors here are independent; those of a learnt object are not, which the covariance reckons
  // with.
  constexpr double kPosesAlike = 8;
  EXPECT_NEAR(kPosesAlike * squared / kTrials, 1, 0.35);
}

TEST_F(CalibrationTest, NamesWhatOnePlaceDoesNotShow) {
  // Only where the object is counts, for how it is turned is hardly known: turns of the camera
  // about itself cannot be told from shifts, and those about the line of sight not at all.
  covariance_.diagonal().tail<3>().setConstant(1);
  const CameraCalibration found = calibrateCamera(sightings(30, 1e-4), stated_, 2);
  EXPECT_GE(found.unseen.size(), 3u);
  EXPECT_NE(found.message.find("about"), std::string::npos) << found.message;
  // As it was stated, in what is not seen: it does not run away.
  EXPECT_LT((found.T_C_V.t - stated_[2].t).norm(), 0.02);
}

TEST_F(CalibrationTest, AFewWrongPosesDoNotMatter) {
  std::vector<RigSighting> all = sightings(40);
  for (int i = 0; i < 4; ++i) all[9 * i][2]->T_V_O.t.y() += 0.03;
  const CameraCalibration found = calibrateCamera(all, stated_, 2);
  EXPECT_LT(errorOf(found).head<3>().norm(), 0.001);
}

TEST_F(CalibrationTest, OtherCamerasThatSawNothingAreLeftOut) {
  std::vector<RigSighting> all = sightings(40);
  for (RigSighting& sighting : all) sighting[1].reset();
  EXPECT_TRUE(calibrateCamera(all, stated_, 2).success);
  for (RigSighting& sighting : all) sighting[0].reset();
  const CameraCalibration found = calibrateCamera(all, stated_, 2);
  EXPECT_FALSE(found.success);
  EXPECT_NE(found.message.find("0 poses"), std::string::npos) << found.message;
}

TEST_F(CalibrationTest, TooFewPosesAreRefused) {
  const CameraCalibration found = calibrateCamera(sightings(19), stated_, 2);
  EXPECT_FALSE(found.success);
  EXPECT_EQ(found.T_C_V.t, stated_[2].t);
  EXPECT_NE(found.message.find("20 are needed"), std::string::npos) << found.message;
}

TEST_F(CalibrationTest, RefusesCamerasThatDoNotExist) {
  EXPECT_THROW(calibrateCamera({}, stated_, 0), std::invalid_argument);
  EXPECT_THROW(calibrateCamera({}, stated_, 3), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
