// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <memory>
#include <vector>

#include "backend/cost_counters.h"
#include "backend/cpu/ray_renderer.h"
#include "backend/hypotheses.h"
#include "backend/loaded_field.h"
#include "backend/plans.h"
#include "backend/pose_solver.h"
#include "field/field.h"
#include "math/pixel_draw.h"

// The paper's mode on the CPU backend: updates worked out by hand.

namespace nerf_pose_refiner {
namespace {

/// Every ray has the same gradient, whatever it sees.
class ConstantGradient final : public RayRenderer {
 public:
  RayGradient gradient = {{0, 0, 0}, {0, 0, 0}};

  const Field& field() const override { return field_; }
  CostCounters renderRays(RaySpan rays, const RenderOptions&, RayResult* results) const override {
    for (int i = 0; i < rays.size; ++i) results[i] = {};
    return costOf(rays);
  }
  CostCounters rayGradients(RaySpan rays, const RenderOptions&, bool, const RayLoss& loss,
                            RayGradient* gradients) const override {
    for (int i = 0; i < rays.size; ++i) {
      loss(i, RayResult());
      gradients[i] = gradient;
    }
    return costOf(rays);
  }

 private:
  static CostCounters costOf(RaySpan rays) {
    CostCounters cost;
    cost.samples = static_cast<std::uint64_t>(rays.size);
    return cost;
  }

  Field field_;
};

Camera smallCamera(int size = 64) { return {size, size, 1.2 * size, 1.2 * size, 31.5, 31.5}; }

Observation blackImage() {
  Observation observation;
  observation.camera = smallCamera();
  observation.image = Image(64, 64, 3);
  observation.background = Background::kKnownColour;
  return observation;
}

/// One hypothesis at the identity in an image, a black one if nothing is said.
struct OneHypothesis {
  explicit OneHypothesis(const Observation& observation = blackImage())
      : solver(scene.makeSolver(observation, {{observation.camera, 0}}, 1)) {
    startAt(Pose());
    plan.samples_per_step = 100;
    plan.steps_per_update = 1;
    plan.regularisation = 0;
    plan.update = PoseUpdate::kAboutCamera;
  }

  void startAt(const Pose& pose) {
    SamplingPlan one;
    one.count = 1;
    solver->sample({pose}, one);
  }
  void optimise(int first_step, int steps) {
    solver->optimise(0, plan, {first_step, steps}, CancellationToken());
  }
  double evaluate(int pixels) {
    solver->evaluate(0, plan, pixels, CancellationToken());
    return solver->readHypotheses().front().loss;
  }
  Pose pose() const { return solver->readHypotheses().front().T_O_C; }

  ConstantGradient scene;
  std::unique_ptr<PoseSolver> solver;
  OptimisationPlan plan;
};

// Adam's first update is the learning rate against the sign of each component.
TEST(Optimise, firstUpdateByHand) {
  OneHypothesis one;
  one.plan.length_unit = 2;
  one.plan.translation_learning_rate = 0.01;
  one.plan.rotation_learning_rate = 0.1;
  one.scene.gradient = {{3, -0.5, 0}, {0, 0, -7}};
  one.optimise(0, 1);
  EXPECT_NEAR((one.pose().t - Eigen::Vector3d(-0.02, 0.02, 0)).norm(), 0, 1e-9);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_NEAR((one.pose().R - turn).norm(), 0, 1e-8);
}

// The rotation is multiplied from the left, in the axes of O, and leaves the camera where it is.
TEST(Optimise, rotationIsAboutTheCameraInTheAxesOfTheObject) {
  OneHypothesis one;
  Pose start;
  start.R = Eigen::AngleAxisd(M_PI / 2, Eigen::Vector3d::UnitX()).toRotationMatrix();
  start.t = {1, 2, 3};
  one.startAt(start);
  one.plan.rotation_learning_rate = 0.1;
  one.scene.gradient = {{0, 0, 0}, {0, 0, 1}};
  one.optimise(0, 1);
  const Eigen::Matrix3d turn = Eigen::AngleAxisd(-0.1, Eigen::Vector3d::UnitZ()).toRotationMatrix();
  EXPECT_NEAR((one.pose().R - turn * start.R).norm(), 0, 1e-8);
  EXPECT_EQ((one.pose().t - start.t).norm(), 0);
}

TEST(Optimise, gradientsAreGatheredOverTheStepsOfAnUpdate) {
  OneHypothesis one;
  one.plan.steps_per_update = 4;
  one.plan.length_unit = 1;
  one.scene.gradient = {{1, 0, 0}, {0, 0, 0}};
  one.optimise(0, 3);
  EXPECT_EQ(one.pose().t.norm(), 0);
  one.scene.gradient = {{-5, 0, 0}, {0, 0, 0}};  // turns the mean over: (1 + 1 + 1 - 5) / 4
  one.optimise(3, 1);
  EXPECT_NEAR(one.pose().t.x(), one.plan.translation_learning_rate, 1e-9);
}

// About the object a turn leads the camera around it.
TEST(Optimise, aTurnAboutTheObjectLeadsTheCameraAroundIt) {
  OneHypothesis one;
  Pose start;
  start.t = {3, 0, 0};
  one.startAt(start);
  one.plan.update = PoseUpdate::kAboutObject;
  one.plan.object_centre = {1, 0, 0};
  one.plan.length_unit = 1;
  one.plan.translation_learning_rate = 1e-12;  // the turn alone
  one.plan.rotation_learning_rate = 0.1;
  one.scene.gradient = {{0, -1, 0}, {0, 0, 0}};  // 2 e_x x -e_y: a torque of -2 about z
  one.optimise(0, 1);
  EXPECT_NEAR(logSO3(one.pose().R).z(), 0.1, 1e-8);
  const Eigen::Vector3d expected(1 + 2 * std::cos(0.1), 2 * std::sin(0.1), 0);
  EXPECT_NEAR((one.pose().t - expected).norm(), 0, 1e-8);
}

// Turned about the object alone, there is no move to be pulled back; the turn is.
TEST(Optimise, aTurnAboutTheObjectIsNoMoveToTheRegularisation) {
  const Vec3<double> centre = {1, 0, 0};
  OptimisationPlan plan;
  plan.object_centre = {1, 0, 0};
  plan.length_unit = 1;
  plan.regularisation = 1;
  DescentMotion motion = {};
  motion.start = {expSO3(Vec3<double>{0, 0, 0}), {3, 0, 0}};
  CameraPose<double> pose = moveCamera(motion.start, centre, {0, 0, 0}, {0, 0, 0.3});
  ASSERT_TRUE(updatePose(plan.rates(1), {0, 0, 0}, {0, 0, 0}, &motion, &pose));
  EXPECT_NEAR(motion.translation.x.first, 0, 1e-12);
  EXPECT_NEAR(motion.translation.y.first, 0, 1e-12);
  EXPECT_NEAR(motion.rotation.z.first, 0.1 * 0.3, 1e-12);  // Adam's beta1 keeps a tenth
}

// As a twist the pose turns about the origin of O: the camera, which is away from it, goes along.
TEST(Optimise, aTwistTurnsAboutTheOrigin) {
  OneHypothesis one;
  Pose start;
  start.t = {2, 0, 0};
  one.startAt(start);
  one.plan.update = PoseUpdate::kTwist;
  one.plan.length_unit = 1;
  one.plan.translation_learning_rate = 1e-12;  // the turn alone
  one.plan.rotation_learning_rate = 0.1;
  one.scene.gradient = {{0, -1, 0}, {0, 0, 0}};  // 2 e_x x -e_y: a torque of -2 about z
  for (int step = 0; step < 3; ++step) one.optimise(step, 1);
  EXPECT_NEAR(logSO3(one.pose().R).z(), 0.3, 1e-2);
  const double turned = logSO3(one.pose().R).z();
  const Eigen::Vector3d along(2 * std::cos(turned), 2 * std::sin(turned), 0);
  EXPECT_NEAR((one.pose().t - along).norm(), 0, 1e-9);
}

// Pixels without a weight are not drawn: the loss is a mean over the others.
TEST(Optimise, pixelsWithoutWeightAreNotDrawn) {
  Observation observation;
  observation.camera = smallCamera();
  observation.image = Image(64, 64, 3);
  observation.weight = Image(64, 64, 1);
  for (int y = 10; y < 20; ++y) {
    for (int x = 40; x < 50; ++x) observation.weight.at(x, y, 0) = 1;
  }
  int weightless = 0;
  const float* weight = observation.weight.values.data();
  for (int i = 0; i < 500; ++i) weightless += weight[drawPixel(1, 2, i, 4096, weight)] == 0;
  EXPECT_LT(weightless, 150);  // (1 - 100 / 4096)^64 = 0.21 of them
  EXPECT_EQ(drawPixel(1, 2, 3, 4096, observation.image.values.data()) < 4096,
            true);  // none has any

  observation.background = Background::kKnownColour;
  observation.background_colour.setConstant(0.5f);  // seen everywhere: a loss of 1 / 4
  EXPECT_NEAR(OneHypothesis(observation).evaluate(500), 0.25, 1e-6);
}

// A constant gradient keeps Adam's direction at one: the steps show the learning rate alone.
TEST(Optimise, learningRateDecaysWithTheUpdatesOfTheWholeRun) {
  OneHypothesis one;
  one.plan.length_unit = 1;
  one.plan.translation_learning_rate = 1;
  one.plan.schedule.decay_updates = 2;
  one.scene.gradient = {{-1, 0, 0}, {0, 0, 0}};
  double x = 0;
  const double expected[5] = {1, 1, 0.33, 0.33, 0.33 * 0.33};
  for (int step = 0; step < 5; ++step) {
    one.optimise(step, 1);
    EXPECT_NEAR(one.pose().t.x() - x, expected[step], 1e-6);
    x = one.pose().t.x();
  }
}

TEST(Optimise, momentsStartAnewAfterResampling) {
  OneHypothesis one;
  one.plan.length_unit = 1;
  one.scene.gradient = {{1, 0, 0}, {0, 0, 0}};
  one.optimise(0, 20);
  one.scene.gradient = {{0, 1, 0}, {0, 0, 0}};
  ResamplingPlan keep;
  keep.keep = 1;
  one.solver->resample(keep);
  const Eigen::Vector3d before = one.pose().t;
  one.optimise(20, 1);
  const Eigen::Vector3d step = one.pose().t - before;
  EXPECT_EQ(step.x(), 0);  // with the old moments it would go on
  EXPECT_NEAR(step.y(), -one.plan.translation_learning_rate, 1e-9);
}

// Without any force a hypothesis is pulled back to where it was seeded.
TEST(Optimise, regularisationGradientsToTheStart) {
  OneHypothesis one;
  one.plan.length_unit = 1;
  one.scene.gradient = {{-1, 0, 0}, {0, -1, 0}};
  one.optimise(0, 50);
  const double away = one.pose().t.x();
  const double turned = rotationDistance(one.pose().R, Eigen::Matrix3d::Identity());
  EXPECT_GT(away, 0.1);
  EXPECT_GT(turned, 0.2);
  one.plan.regularisation = 1;
  one.scene.gradient = {{0, 0, 0}, {0, 0, 0}};
  one.optimise(50, 200);
  EXPECT_LT(std::abs(one.pose().t.x()), 0.5 * away);
  EXPECT_LT(rotationDistance(one.pose().R, Eigen::Matrix3d::Identity()), 0.5 * turned);
}

TEST(Optimise, aGradientThatIsNotFiniteEndsTheHypothesis) {
  OneHypothesis one;
  one.scene.gradient = {{NAN, 0, 0}, {0, 0, 0}};
  one.optimise(0, 2);
  EXPECT_EQ(one.solver->readHypotheses().front().state, HypothesisState::kNotFinite);
  EXPECT_TRUE(one.pose().isFinite());
}

TEST(Optimise, stopsOnRequest) {
  OneHypothesis one;
  const CancellationToken cancellation;
  cancellation.requestCancel();
  EXPECT_THROW(one.solver->optimise(0, one.plan, {0, 1}, cancellation), Cancelled);
}

// L1 of a black rendering (an empty scene) against an image of one grey: the grey.
TEST(Evaluate, isTheMeanOfTheChannelsOverThePixels) {
  Observation grey;
  grey.camera = smallCamera();
  grey.image = Image(64, 64, 3, 0.25f);
  grey.background = Background::kKnownColour;
  OneHypothesis one(grey);
  one.plan.loss = Loss::kL1;
  EXPECT_NEAR(one.evaluate(100), 0.25, 1e-6);
}

// Where nothing of the object is seen nothing can be said: the worst score there is.
TEST(Evaluate, anUnseenObjectOnAnUnknownBackgroundScoresWorst) {
  Observation photo;
  photo.camera = smallCamera();
  photo.image = Image(64, 64, 3, 0.25f);
  EXPECT_TRUE(std::isinf(OneHypothesis(photo).evaluate(100)));
}

}  // namespace
}  // namespace nerf_pose_refiner
