// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/pose_correction.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>

#include "backend/make_backend.h"
#include "math/angle.h"
#include "math/random.h"
#include "registration/field_training.h"
#include "registration/view_quality.h"
#include "support/analytic_dataset.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"

namespace nerf_pose_refiner {
namespace {

/// Normally distributed, about (a sum of uniform numbers), of standard deviation 1.
double noise(std::uint64_t view, std::uint64_t axis) {
  double sum = -6;
  for (std::uint64_t k = 0; k < 12; ++k) sum += randomUniform(7, view, 12 * axis + k);
  return sum;
}

/// What a robot's kinematics do to a camera's pose, standard deviations per axis.
Pose noisy(const Pose& T_O_C, std::uint64_t view, double rotation_rad, double translation) {
  Eigen::Vector3d turn, move;
  for (std::uint64_t axis = 0; axis < 3; ++axis) {
    turn[axis] = rotation_rad * noise(view, axis);
    move[axis] = translation * noise(view, 3 + axis);
  }
  return {T_O_C.R * expSO3(turn), T_O_C.t + move};
}

/// 0.5 degrees, and 1 % of the object: 2 mm where that measures 0.2 m.
Dataset withNoise(const Dataset& dataset) {
  Dataset result = dataset;
  for (std::size_t i = 0; i < result.views.size(); ++i) {
    Pose& pose = result.views[i].T_O_C;
    pose = noisy(pose, i, 0.5 * kDegree, 0.01);
  }
  return result;
}

/// Of the object's centre as the cameras see it: root of the mean square.
double offset(const std::vector<Pose>& poses, const std::vector<PosedView>& truth,
              const Eigen::Vector3d& centre) {
  double squares = 0;
  for (std::size_t i = 0; i < poses.size(); ++i) {
    squares += (poses[i].inverse() * centre - truth[i].T_O_C.inverse() * centre).squaredNorm();
  }
  return std::sqrt(squares / static_cast<double>(poses.size()));
}

TEST(InMeasuredFrame, UndoesASimilarity) {
  const Eigen::Vector3d centre(0.1, 0.2, -0.1);
  const Dataset dataset = analyticDataset(5, 8);
  const Eigen::Matrix3d turn = expSO3({0.02, -0.03, 0.05});
  const double scale = 1.02;
  std::vector<Pose> measured, moved;
  for (const PosedView& view : dataset.views) {
    measured.push_back(view.T_O_C);
    const Eigen::Vector3d from_centre = view.T_O_C.t - centre;
    moved.emplace_back(turn * view.T_O_C.R, centre + turn * (scale * from_centre));
  }
  const std::vector<Pose> back = inMeasuredFrame(moved, measured);
  for (std::size_t i = 0; i < back.size(); ++i) {
    EXPECT_TRUE(back[i].R.isApprox(measured[i].R, 1e-9)) << i;
    EXPECT_TRUE(back[i].t.isApprox(measured[i].t, 1e-9)) << i;
    EXPECT_TRUE(back[i].isRigid(1e-9));
  }
}

TEST(InMeasuredFrame, NoiseOfManyViewsIsAveraged) {
  const Dataset truth = analyticDataset(40, 8);
  const Dataset measured = withNoise(truth);
  std::vector<Pose> refined, with_noise;
  for (std::size_t i = 0; i < truth.views.size(); ++i) {
    refined.push_back(truth.views[i].T_O_C);
    with_noise.push_back(measured.views[i].T_O_C);
  }
  const std::vector<Pose> poses = inMeasuredFrame(refined, with_noise);
  for (std::size_t i = 0; i < poses.size(); ++i) {
    EXPECT_LT(rotationDistance(poses[i].R, refined[i].R), 0.4 * kDegree);
    EXPECT_LT((poses[i].t - refined[i].t).norm(), 0.02);
  }
}

TEST(InMeasuredFrame, CentresOnALineTellNoFrame) {
  std::vector<Pose> refined, measured;
  for (int i = 0; i < 5; ++i) {
    refined.emplace_back(expSO3({0.1 * i, 0, 0}), Eigen::Vector3d(i, 0, 0));
    measured.emplace_back(refined.back().R, Eigen::Vector3d(0, i, 0));
  }
  const std::vector<Pose> poses = inMeasuredFrame(refined, measured);
  for (std::size_t i = 0; i < poses.size(); ++i) EXPECT_EQ(poses[i].t, refined[i].t);
  refined.resize(2);
  measured.resize(2);
  EXPECT_EQ(inMeasuredFrame(refined, measured)[1].t, refined[1].t);
}

TEST(AlignViews, FindsTheCamerasOfAnExactModel) {
  const auto scene = makeAnalyticScene(1, cpuProcessor(2));
  const FieldMetadata& object = scene->field().metadata;
  const Dataset truth = analyticDataset(6, 64);
  const Dataset measured = withNoise(truth);
  std::vector<Pose> before;
  for (const PosedView& view : measured.views) before.push_back(view.T_O_C);
  const std::vector<Pose> after = alignViews(*scene, measured.views, before, true, {});
  // Sideways they are found; how far the object is away stays as it was measured, about.
  EXPECT_LT(offset(after, truth.views, object.centre),
            0.5 * offset(before, truth.views, object.centre));
}

TEST(AlignViews, LeavesViewsAloneThatSeeNothing) {
  const auto scene = makeAnalyticScene();
  Dataset dataset = analyticDataset(1, 16);
  Pose& pose = dataset.views[0].T_O_C;
  pose.R = pose.R * expSO3({0, 3.1, 0});  // the object is behind the camera
  const std::vector<Pose> after = alignViews(*scene, dataset.views, {pose}, true, {});
  EXPECT_EQ(after[0].R, pose.R);
  EXPECT_EQ(after[0].t, pose.t);
}

TEST(RefinePoses, AModelOfNoisyPosesIsBetterWithIt) {
  const auto backend = makeCpuBackend(2);
  const Dataset truth = analyticDataset(32, 48);
  RegistrationOptions settings;
  settings.steps = 320;  // of which the rough trainings have a quarter each
  settings.samples_per_step = 4096;
  const auto psnr = [&] {
    const auto field = std::make_shared<Field>(
        trainField(backend.get(), withNoise(truth), settings, {}, {}).field);
    return meanPsnr(*backend->load(field), truth.views, {});
  };
  const double without = psnr();
  settings.refine_poses = true;
  EXPECT_GT(psnr(), without + 0.5);
}

}  // namespace
}  // namespace nerf_pose_refiner
