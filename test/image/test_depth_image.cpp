// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>

#include "nerf_pose_refiner/depth.h"

namespace nerf_pose_refiner {
namespace {

const Camera kDepthCamera = {3, 2, 2, 2, 1, 0.5};

TEST(DepthImage, ReadsMetresAndHoles) {
  ImageOf<float> metres(3, 2, 1, 0.75f);
  metres.at(1, 0, 0) = std::numeric_limits<float>::quiet_NaN();
  metres.at(2, 0, 0) = std::numeric_limits<float>::infinity();
  metres.at(0, 1, 0) = -0.5f;
  const auto depth = depthImage(std::move(metres), kDepthCamera);
  EXPECT_EQ(depth->at(0, 0), 0.75f);
  EXPECT_EQ(depth->at(1, 0), 0);
  EXPECT_EQ(depth->at(2, 0), 0);
  EXPECT_EQ(depth->at(0, 1), 0);
  EXPECT_EQ(depth->at(2, 1), 0.75f);
}

TEST(DepthImage, ReadsMultiplesOfAUnitAndHoles) {
  ImageOf<std::uint16_t> values(3, 2, 1, 640);
  values.at(1, 1, 0) = 0;
  DepthImage depth = *depthImage(std::move(values), kDepthCamera);
  EXPECT_NEAR(depth.at(2, 0), 0.64, 1e-6);
  EXPECT_EQ(depth.at(1, 1), 0);
  depth.unit_m = 0.0001;
  EXPECT_NEAR(depth.at(2, 0), 0.064, 1e-7);
}

TEST(DepthImage, ReadsRowsThatArePadded) {
  const std::uint16_t values[] = {1000, 2000, 3000, 9, 4000, 5000, 6000, 9};
  DepthImage depth;
  depth.data = values;
  depth.row_bytes = 8;
  depth.camera = kDepthCamera;
  EXPECT_FLOAT_EQ(depth.at(2, 0), 3);
  EXPECT_FLOAT_EQ(depth.at(0, 1), 4);
}

TEST(DepthImage, NoiseGrowsWithTheSquareOfDistance) {
  DepthNoise noise;
  noise.constant_m = 0.003;
  noise.quadratic_per_m = 0.004;
  EXPECT_NEAR(noise.deviation_m(1), 0.005, 1e-12);  // 3, 4, 5
  EXPECT_NEAR(noise.deviation_m(2), std::hypot(3e-3, 16e-3), 1e-12);
  EXPECT_NEAR(noise.deviation_m(1, 0.012), std::hypot(5e-3, 12e-3 / std::sqrt(12.0)), 1e-12);
  noise.bias_m = 0.003;
  noise.bias_fraction = 0.002;
  EXPECT_NEAR(noise.biasDeviation_m(2), 0.005, 1e-12);
}

TEST(DepthImage, RefusesWhatMakesNoSense) {
  const auto refused = [](auto change) {
    DepthImage depth = *depthImage(ImageOf<float>(3, 2, 1, 1.0f), kDepthCamera);
    change(&depth);
    EXPECT_THROW(depth.validate(), std::invalid_argument);
  };
  refused([](DepthImage* depth) { depth->data = nullptr; });
  refused([](DepthImage* depth) { depth->row_bytes = 8; });
  refused([](DepthImage* depth) { depth->unit_m = 0; });
  refused([](DepthImage* depth) { depth->camera.fx = 0; });
  refused([](DepthImage* depth) { depth->T_C_D.R *= 2; });
  refused([](DepthImage* depth) { depth->noise.constant_m = -1; });
  refused([](DepthImage* depth) { depth->noise.correlation_px = 0; });
  refused([](DepthImage* depth) { depth->noise.bias_m = std::nan(""); });
  refused([](DepthImage* depth) { depth->noise.constant_m = depth->noise.quadratic_per_m = 0; });
  EXPECT_THROW(depthImage(ImageOf<float>(2, 2, 1, 1.0f), kDepthCamera), std::invalid_argument);
  EXPECT_THROW(depthImage(ImageOf<float>(3, 2, 2, 1.0f), kDepthCamera), std::invalid_argument);
}

}  // namespace
}  // namespace nerf_pose_refiner
