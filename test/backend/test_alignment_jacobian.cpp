// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>

#include "backend/cpu/alignment_system.h"
#include "backend/cpu/rendered_image.h"
#include "backend/loaded_field.h"
#include "field/field.h"
#include "image/filter.h"
#include "support/analytic_scene.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kBlurPx = 1.5;
const Camera kJacobianCamera = {96, 80, 150, 150, 47.5, 39.5};

// Rendering as alignment makes it: several rays a pixel, blurred.
Image blurredRendering(const RayRenderer& scene, const Pose& T_O_C) {
  Image image, scratch;
  renderImages(scene, {{kJacobianCamera, T_O_C, 8, &image}}, RenderOptions(), CancellationToken());
  blurImage(gaussianKernel(kBlurPx), &image, &scratch);
  return image;
}

Pose moved(const Pose& T_O_C, const Eigen::Vector3d& centre, int axis, double step) {
  Eigen::Vector3d v = Eigen::Vector3d::Zero(), w = Eigen::Vector3d::Zero();
  (axis < 3 ? v : w)[axis % 3] = step;
  const Eigen::Matrix3d turn = expSO3(w);
  return {turn * T_O_C.R, centre + v + turn * (T_O_C.t - centre)};
}

class AlignmentJacobian : public ::testing::TestWithParam<int> {};

// The predicted change of all four channels over the image against the one that is rendered.
// An image's flow explains it except where a surface turns away behind its own edge.
TEST_P(AlignmentJacobian, AgreesWithCentralDifferences) {
  const auto scene = makeAnalyticScene();
  const Eigen::Vector3d centre = scene->field().metadata.centre;
  const Pose T_O_C = cameraAround(*scene, 0.6, 0.4);
  const double step = 1e-2;
  const Image image = blurredRendering(*scene, T_O_C);
  const Image after = blurredRendering(*scene, moved(T_O_C, centre, GetParam(), step));
  const Image before = blurredRendering(*scene, moved(T_O_C, centre, GetParam(), -step));

  ObservedLevel level;
  level.camera = kJacobianCamera;
  AlignmentTarget target;
  target.level = &level;
  target.observed = &image;  // so that the mean of both images' gradients is the rendering's
  target.centre = centre;
  const AlignmentView view = viewOf(target, T_O_C);
  // With the rendered change in the place of the residual the normal equations hold its product
  // with the predicted change, and the square of the latter.
  NormalEquations6<float> equations;
  double rendered_square = 0;
  for (int y = 1; y + 1 < kJacobianCamera.height; ++y) {
    for (int x = 1; x + 1 < kJacobianCamera.width; ++x) {
      PixelResidual<float> r = residualAt(target, image, GainBias<float>(), x, y);
      for (int c = 0; c < 4; ++c) {
        r.value[c] = static_cast<float>((after.at(x, y, c) - before.at(x, y, c)) / (2 * step));
        rendered_square += r.value[c] * r.value[c];
      }
      const float weights[4] = {1, 1, 1, 1};
      addPixel(flowAt(view, image, x, y), r, weights, &equations);
    }
  }
  const int axis = GetParam();
  const double dot = equations.gradient[axis];
  const double predicted_square = equations.information[axis * (axis + 3) / 2];
  // When the camera turns about the object, surfaces of the ball come out behind its edge.
  const bool turns = axis >= 3;
  EXPECT_GT(dot / std::sqrt(predicted_square * rendered_square), turns ? 0.96 : 0.998);
  EXPECT_NEAR(std::sqrt(predicted_square / rendered_square), 1.0, turns ? 0.12 : 0.03);
}

std::string axisName(const ::testing::TestParamInfo<int>& axis) {
  const char* names[6] = {"vx", "vy", "vz", "wx", "wy", "wz"};
  return names[axis.param];
}

INSTANTIATE_TEST_SUITE_P(SixAxes, AlignmentJacobian, ::testing::Range(0, 6), axisName);

}  // namespace
}  // namespace nerf_pose_refiner
