// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/photo_gains.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "backend/make_backend.h"
#include "math/random.h"
#include "registration/field_training.h"
#include "registration/view_quality.h"
#include "support/analytic_dataset.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"

namespace nerf_pose_refiner {
namespace {

/// Another exposure and white balance for each view; the median of each channel is 1.
std::vector<PhotoGain> exposures(std::size_t count) {
  std::vector<PhotoGain> gains(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double spread = 2.0 * static_cast<double>(i) / static_cast<double>(count - 1) - 1;
    gains[i].gain = Eigen::Array3d(0.2, 0.25, 0.15) * spread + 1;
  }
  return gains;
}

std::vector<PosedView> exposed(const std::vector<PosedView>& views) {
  return withGains(views, exposures(views.size()));
}

TEST(PhotoGains, ChangeColoursAndNotAlpha) {
  PosedView view;
  Image8 image(2, 1, 4);
  image.values = {100, 200, 10, 255, 0, 255, 50, 7};
  view.rgba = std::make_shared<const Image8>(image);
  PhotoGain gain;
  gain.gain = {0.5, 2, 1};
  gain.bias = {0.1, 0, -0.1};
  const std::vector<PosedView> changed = withGains({view}, {gain});
  // 50 + 25.5, 400 clipped, 10 - 25.5 clipped; 0 + 25.5, 510 clipped, 50 - 25.5 (just below 24.5).
  EXPECT_EQ(changed[0].rgba->values, (std::vector<std::uint8_t>{76, 255, 0, 255, 26, 255, 24, 7}));
}

TEST(PhotoGains, FollowOneAnother) {
  PhotoGain first, second;
  first.gain = {2, 1, 1};
  first.bias = {0.1, 0, 0};
  second.gain = {3, 1, 1};
  second.bias = {0.2, 0, 0};
  EXPECT_NEAR(combined(first, second)(Eigen::Array3d::Constant(0.1))[0], 3 * 0.3 + 0.2, 1e-12);
}

TEST(PhotoGains, SpreadIsTheChangeOfAMeanGrey) {
  std::vector<PhotoGain> gains(2);
  EXPECT_EQ(gainSpread(gains), 0);
  gains[0].gain[1] = std::exp(0.1);
  EXPECT_NEAR(gainSpread(gains), 0.1 / std::sqrt(2), 1e-9);
  EXPECT_EQ(gainSpread({}), 0);
}

TEST(PhotoGains, AreFoundWithAnExactModel) {
  const auto scene = makeAnalyticScene(1, cpuProcessor(2));
  const Dataset truth = analyticDataset(7, 64);
  EXPECT_LT(gainSpread(photoGains(*scene, truth.views, {})), 0.02);
  const std::vector<PhotoGain> made = exposures(7);
  const std::vector<PhotoGain> found = photoGains(*scene, exposed(truth.views), {});
  const Eigen::Array3d grey = Eigen::Array3d::Constant(0.4);
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Eigen::Array3d back = found[i](made[i](grey));
    EXPECT_LT((back - grey).abs().maxCoeff(), 0.025) << i << ": " << back.transpose();
  }
}

TEST(PhotoGains, AViewThatShowsNothingKeepsItsColours) {
  const auto scene = makeAnalyticScene();
  Dataset dataset = analyticDataset(3, 32);
  dataset.views[1].T_O_C.R = dataset.views[1].T_O_C.R * expSO3({0, 3.1, 0});
  const std::vector<PhotoGain> gains = photoGains(*scene, dataset.views, {});
  EXPECT_EQ(gains[1].gain[0], 1);
  EXPECT_EQ(gains[1].bias[2], 0);
}

TEST(EqualColours, AModelOfPhotosOfDifferentExposureIsAlmostAsGoodAsOfEqualOnes) {
  const auto backend = makeCpuBackend(2);
  const Dataset truth = analyticDataset(33, 48);
  Dataset spoiled = truth;
  spoiled.views = exposed(truth.views);
  RegistrationOptions settings;
  settings.steps = 1024;  // the rough trainings have a quarter each
  settings.samples_per_step = 4096;
  double spread = 0;
  const auto psnr = [&](const Dataset& dataset) {
    const auto field =
        std::make_shared<Field>(trainField(backend.get(), dataset, settings, {}, {}).field);
    spread = field->metadata.exposure_spread;
    return meanPsnr(*backend->load(field), truth.views, {});
  };
  const double best = psnr(truth);
  EXPECT_EQ(spread, 0);  // equal exposures are left alone
  const double equalled = psnr(spoiled);
  EXPECT_NEAR(spread, 0.14, 0.05);
  EXPECT_GT(equalled, best - 2);
  if (std::getenv("NERF_POSE_REFINER_LONG_TESTS") == nullptr) return;
  settings.keep_colours = true;
  EXPECT_LT(psnr(spoiled), equalled - 1);
  EXPECT_EQ(spread, 0);
}

}  // namespace
}  // namespace nerf_pose_refiner
