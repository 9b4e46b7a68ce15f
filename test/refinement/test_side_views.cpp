// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/side_views.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>
#include <string>

#include "evaluation/pose_error.h"
#include "refinement/keyframe_refiner.h"
#include "support/depth_scene.h"

namespace nerf_pose_refiner {
namespace {

TEST(JoinedViews, AddTheirInformation) {
  ViewOpinion a, b;
  a.noise = Matrix6::Identity();
  b.noise = 2 * Matrix6::Identity();
  b.twist[2] = 3;
  const ViewOpinion both = joined({a, b});
  EXPECT_NEAR(both.twist[2], 1, 1e-12);  // (0 / 1 + 3 / 2) / (1 / 1 + 1 / 2)
  EXPECT_NEAR(both.twist[1], 0, 1e-12);
  EXPECT_NEAR(both.noise(2, 2), 2.0 / 3, 1e-12);
}

TEST(JoinedViews, KeepTheErrorThatTheyShare) {
  ViewOpinion a, b;
  a.noise = Matrix6::Identity();
  b.noise = 4 * Matrix6::Identity();
  a.model = b.model = 0.09 * Matrix6::Identity();
  EXPECT_NEAR(joined({a, b}).model(3, 3), 0.09, 1e-12);
  EXPECT_NEAR(joined({a, b, b, b}).model(3, 3), 0.09, 1e-12);
}

class SideViewsTest : public DepthScene, public testing::Test {
 protected:
  static constexpr double kApart_rad = 1.2;

  Pose sideTruth() const { return cameraAround(*scene_, 0.6 + kApart_rad, 0.5); }

  SideView side(std::shared_ptr<const Observation> image) const {
    SideView view;
    view.observation = std::move(image);
    view.T_C_V = truth_.inverse() * sideTruth();
    view.T_C_V.t *= kUnit_m;
    view.position_dev_m = view.rotation_dev_rad = 5e-5;
    return view;
  }

  std::shared_ptr<const Observation> noisy(Observation image, std::uint64_t seed) const {
    for (std::size_t i = 0; i < image.image.values.size(); ++i) {
      float& value = image.image.values[i];
      value += 0.1f * static_cast<float>(randomUniform(seed, 9, i) - 0.5);
      value = std::clamp(value, 0.0f, 1.0f);
    }
    return std::make_shared<const Observation>(std::move(image));
  }

  Observation nothing() const {
    Observation image = imageAt(truth_);
    image.image = clutter(kColour.width, kColour.height, 7);
    return image;
  }

  Refinement follow(const Observation& observation) const {
    KeyframeSearchSettings settings;
    settings.real_time = false;
    KeyframeRefiner refiner(backend_.get(), field_, settings);
    Prior prior;
    prior.T_O_C = fartherBy(truth_, 0.004);
    prior.rotation_rad = 5 * kDegree;
    prior.translation = 0.05;
    return refiner.follow({observation, 0}, prior);
  }

  double alongVariance(const Refinement& found) const {
    const Eigen::Vector3d sight = (truth_.t - object().centre).normalized();
    return sight.dot(found.covariance.topLeftCorner<3, 3>() * sight);
  }

  std::unique_ptr<Backend> backend_ = makeCpuBackend(2);
};

TEST_F(SideViewsTest, ASecondCameraTellsTheDistance) {
  double alone_m = 0, both_m = 0;
  for (std::uint64_t seed = 0; seed < 4; ++seed) {
    Observation observation = *noisy(imageAt(truth_), 2 * seed);
    const Refinement alone = follow(observation);
    observation.beside = {side(noisy(imageAt(sideTruth()), 2 * seed + 1))};
    const Refinement both = follow(observation);
    ASSERT_EQ(both.beside.size(), 1u);
    EXPECT_TRUE(both.beside[0].used) << both.beside[0].message;
    EXPECT_LT(alongVariance(both), 0.5 * alongVariance(alone));
    EXPECT_GE(both.score, 0.9);
    alone_m += std::abs(alongSight(alone.T_O_C));
    both_m += std::abs(alongSight(both.T_O_C));
    const PoseError error = poseError(both.T_O_C, truth_, object().centre, kColour);
    EXPECT_LT(error.rotation_rad / kDegree, 0.3);
  }
  EXPECT_LT(both_m, alone_m);
}

TEST_F(SideViewsTest, ACoveredCameraHasNoSay) {
  Observation observation = imageAt(truth_);
  const Refinement alone = follow(observation);
  observation.beside = {side(std::make_shared<const Observation>(nothing()))};
  const Refinement found = follow(observation);
  ASSERT_EQ(found.beside.size(), 1u);
  EXPECT_FALSE(found.beside[0].used);
  EXPECT_NE(found.beside[0].message, "");
  EXPECT_EQ(found.T_O_C.t, alone.T_O_C.t);
  EXPECT_EQ(found.covariance, alone.covariance);
}

TEST_F(SideViewsTest, OtherCamerasFindWhatTheFirstDoesNotSee) {
  Observation observation = nothing();
  EXPECT_LT(follow(observation).score, 0.5);
  observation.beside = {side(std::make_shared<const Observation>(imageAt(sideTruth())))};
  const Refinement found = follow(observation);
  EXPECT_TRUE(found.beside[0].used) << found.beside[0].message;
  const PoseError error = poseError(found.T_O_C, truth_, object().centre, kColour);
  EXPECT_LT(error.rotation_rad / kDegree, 0.5);
  EXPECT_LT(error.object_offset / object().diameter, 0.02);
  EXPECT_GT(found.score, 0.9);
}

TEST_F(SideViewsTest, ACameraThatIsElsewhereIsRefused) {
  Observation observation = imageAt(truth_);
  const Refinement alone = follow(observation);
  observation.beside = {side(std::make_shared<const Observation>(imageAt(sideTruth())))};
  observation.beside[0].T_C_V.t += Eigen::Vector3d(0, 0.02, 0);
  const Refinement found = follow(observation);
  EXPECT_FALSE(found.beside[0].used);
  EXPECT_NE(found.beside[0].message.find("another pose"), std::string::npos)
      << found.beside[0].message;
  EXPECT_EQ(found.T_O_C.t, alone.T_O_C.t);
}

TEST_F(SideViewsTest, RefusesWhatMakesNoSense) {
  Observation observation = imageAt(truth_);
  observation.beside = {side(nullptr)};
  EXPECT_THROW(observation.validate(), std::invalid_argument);
  Observation nested = imageAt(truth_);
  nested.beside = {side(std::make_shared<const Observation>(imageAt(sideTruth())))};
  EXPECT_NO_THROW(nested.validate());
  observation.beside = {side(std::make_shared<const Observation>(nested))};
  EXPECT_THROW(observation.validate(), std::invalid_argument);
  observation.beside = nested.beside;
  observation.beside[0].T_C_V.R *= 2;
  EXPECT_THROW(observation.validate(), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
