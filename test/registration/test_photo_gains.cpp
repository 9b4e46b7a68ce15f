// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/photo_gains.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <vector>

#include "backend/make_backend.h"
#include "math/random.h"
#include "registration/equal_colours.h"
#include "registration/field_training.h"
#include "registration/view_quality.h"
#include "support/analytic_dataset.h"
#include "support/analytic_scene.h"
#include "support/cpu_processor.h"

namespace nerf_pose_refiner {
namespace {

/// Another exposure and white balance for each view, whatever its direction, which repeat after
/// so many views; the median of each channel is 1.
std::vector<PhotoGain> exposures(std::size_t count, std::size_t period) {
  std::vector<PhotoGain> gains(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t place = i % period;
    const double spread = 2.0 * static_cast<double>(place) / static_cast<double>(period - 1) - 1;
    gains[i].gain = Eigen::Array3d(0.2, 0.25, 0.15) * spread + 1;
  }
  return gains;
}

std::vector<PosedView> exposed(const std::vector<PosedView>& views) {
  return withGains(views, exposures(views.size(), 5), 2);
}

TEST(PhotoGains, ChangeColoursAndNotAlpha) {
  PosedView view;
  Image8 image(2, 1, 4);
  image.values = {100, 200, 10, 255, 0, 255, 50, 7};
  view.rgba = std::make_shared<const Image8>(image);
  PhotoGain gain;
  gain.gain = {0.5, 2, 1};
  gain.bias = {0.1, 0, -0.1};
  const std::vector<PosedView> changed = withGains({view}, {gain}, 2);
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
  EXPECT_LT(gainSpread(photoGains(*scene, truth.views, 2, {})), 0.02);
  const std::vector<PhotoGain> made = exposures(7, 7);
  const std::vector<PhotoGain> found = photoGains(*scene, withGains(truth.views, made, 2), 2, {});
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
  const std::vector<PhotoGain> gains = photoGains(*scene, dataset.views, 2, {});
  EXPECT_EQ(gains[1].gain[0], 1);
  EXPECT_EQ(gains[1].bias[2], 0);
}

// --- with the CPU backend

RegistrationOptions shortTraining() {
  RegistrationOptions settings;
  settings.steps = 1024;  // the comparisons have a quarter each
  settings.samples_per_step = 4096;
  return settings;
}

EqualColours equalColours(const Dataset& dataset, const RegistrationOptions& settings) {
  const auto backend = makeCpuBackend(2);
  return withEqualColours(backend.get(), dataset, settings, {}, {});
}

/// By how much colours differ, beyond a change that all views share (@see gainSpread).
double colourSpread(const std::vector<PosedView>& views, const std::vector<PosedView>& truth) {
  std::vector<PhotoGain> gains(views.size());
  std::vector<double> all;
  for (std::size_t i = 0; i < views.size(); ++i) {
    double sum = 0, true_sum = 0;
    for (std::size_t p = 1; p < truth[i].rgba->values.size(); p += 4) {  // green
      if (truth[i].rgba->values[p + 2] < 255) continue;
      sum += views[i].rgba->values[p];
      true_sum += truth[i].rgba->values[p];
    }
    gains[i].gain[1] = sum / true_sum;
    all.push_back(gains[i].gain[1]);
  }
  std::sort(all.begin(), all.end());
  for (PhotoGain& gain : gains) gain.gain[1] /= all[all.size() / 2];
  return gainSpread(gains);
}

TEST(EqualColours, ExposuresThatRepeatAreMadeEqual) {
  const Dataset truth = analyticDataset(33, 48);
  Dataset spoiled = truth;
  spoiled.views = exposed(truth.views);
  EXPECT_GT(colourSpread(spoiled.views, truth.views), 0.1);
  const EqualColours equal = equalColours(spoiled, shortTraining());
  ASSERT_TRUE(equal.spread);
  EXPECT_NEAR(*equal.spread, 0.14, 0.05);
  EXPECT_LT(colourSpread(equal.dataset.views, truth.views), 0.03);
  RegistrationOptions settings = shortTraining();
  settings.keep_colours = true;
  EXPECT_FALSE(equalColours(spoiled, settings).spread);
}

TEST(EqualColours, AShortTrainingSaysThatItDidNotCompare) {
  const Dataset truth = analyticDataset(5, 16);
  RegistrationOptions settings = shortTraining();
  settings.steps = 64;
  const EqualColours equal = equalColours(truth, settings);
  EXPECT_FALSE(equal.spread);
  EXPECT_EQ(equal.dataset.views[3].rgba->values, truth.views[3].rgba->values);
}

TEST(EqualColours, EqualExposuresAreLeftAlone) {
  const Dataset truth = analyticDataset(33, 48);
  const EqualColours equal = equalColours(truth, shortTraining());
  EXPECT_EQ(equal.spread, 0);
  EXPECT_EQ(equal.dataset.views[7].rgba->values, truth.views[7].rgba->values);
}

TEST(EqualColours, AShinyObjectIsLeftAlone) {
  Dataset shiny = analyticDataset(64, 48);
  std::vector<PhotoGain> gains(shiny.views.size());
  for (std::size_t i = 0; i < gains.size(); ++i) {  // brighter from one side
    gains[i].gain = 1 + 0.25 * shiny.views[i].T_O_C.t.normalized().x();
  }
  shiny.views = withGains(shiny.views, gains, 2);
  EXPECT_EQ(equalColours(shiny, shortTraining()).spread, 0);
}

TEST(EqualColours, AModelOfPhotosOfDifferentExposureIsAlmostAsGoodAsOfEqualOnes) {
  if (std::getenv("NERF_POSE_REFINER_LONG_TESTS") == nullptr) {
    GTEST_SKIP() << "NERF_POSE_REFINER_LONG_TESTS is not set";
  }
  const auto backend = makeCpuBackend(2);
  const Dataset truth = analyticDataset(33, 48);
  Dataset spoiled = truth;
  spoiled.views = exposed(truth.views);
  RegistrationOptions settings = shortTraining();
  const auto psnr = [&](const Dataset& dataset) {
    const auto field =
        std::make_shared<Field>(trainField(backend.get(), dataset, settings, {}, {}).field);
    return meanPsnr(*backend->load(field), truth.views, {});
  };
  const double equalled = psnr(spoiled);
  EXPECT_GT(equalled, psnr(truth) - 2);
  settings.keep_colours = true;
  EXPECT_LT(psnr(spoiled), equalled - 1);
}

}  // namespace
}  // namespace nerf_pose_refiner
