// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/data_check.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <stdexcept>

#include "backend/make_backend.h"
#include "registration/registrar.h"
#include "support/analytic_dataset.h"
#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

/// Three photos that differ, from x = 0, 1 and 2.
Dataset threeViews() {
  Dataset dataset;
  for (int i = 0; i < 3; ++i) {
    PosedView view;
    view.rgba = std::make_shared<Image8>(2, 2, 4, static_cast<std::uint8_t>(i));
    view.T_O_C.t = {static_cast<double>(i), 0, 0};
    dataset.views.push_back(view);
  }
  return dataset;
}

TEST(DataCheck, WantsThreeDifferentPhotos) {
  Dataset dataset = threeViews();
  EXPECT_NO_THROW(requireDifferentViews(dataset));
  dataset.views[2].rgba = std::make_shared<Image8>(*dataset.views[0].rgba);
  expectError<std::runtime_error>([&] { requireDifferentViews(dataset); },
                                  "of the 3 photos only 2 differ", "accept_poor_data");
}

TEST(DataCheck, WantsThreeDifferentPoses) {
  Dataset dataset = threeViews();
  dataset.views[2].T_O_C.t.x() = 1 + 1e-9;
  expectError<std::runtime_error>([&] { requireDifferentViews(dataset); },
                                  "3 photos have 2 different poses", "accept_poor_data");
  dataset.views[2].T_O_C.R = expSO3({0, 0.001, 0});
  EXPECT_NO_THROW(requireDifferentViews(dataset));
}

TEST(DataCheck, WantsDirectionsThatDiffer) {
  Dataset dataset = threeViews();
  EXPECT_NO_THROW(requireDirections(dataset, {0, 0, 20}));  // 2 / 20 rad
  expectError<std::runtime_error>(
      [&] {
        requireDirections(dataset, {0, 0, 100});
      },
      "one direction", "accept_poor_data");  // 2 / 100 rad
}

FieldMetadata measured(double loss, int found) {
  FieldMetadata object;
  object.score.views = 4;
  object.score.mean_loss = loss;
  object.pose.views = found;
  return object;
}

TEST(DataCheck, WantsAModelThatLooksLikeThePhotosAndFindsThem) {
  EXPECT_NO_THROW(requireUsableModel(measured(0.31, 3), 12));  // 10.17 dB
  expectError<std::runtime_error>([] { requireUsableModel(measured(0.32, 12), 12); }, "PSNR 9.9 dB",
                                  "accept_poor_data");
  expectError<std::runtime_error>([] { requireUsableModel(measured(0.18, 2), 12); }, "of 12 photos",
                                  "poses of 2 again", "accept_poor_data");
  EXPECT_NO_THROW(requireUsableModel(measured(0.17, 2), 12));  // 15.4 dB
  EXPECT_NO_THROW(requireUsableModel(measured(0.18, 0), 3));   // too few to tell
  FieldMetadata unknown = measured(0, 12);
  unknown.score.views = 0;
  EXPECT_NO_THROW(requireUsableModel(unknown, 12));
  unknown.pose.views = 2;
  expectError<std::runtime_error>([&] { requireUsableModel(unknown, 12); }, "poses of 2 again");
}

// --- with the CPU backend

RegistrationOptions fewSteps() {
  RegistrationOptions settings;
  settings.steps = 80;
  settings.samples_per_step = 4096;
  return settings;
}

void expectRefused(const Dataset& dataset, const std::string& reason) {
  const auto backend = makeCpuBackend(1);
  RegistrationOptions settings = fewSteps();
  expectError<std::runtime_error>([&] { learnField(backend.get(), dataset, settings, {}, {}); },
                                  reason, "accept_poor_data");
}

TEST(DataCheck, OnePhotoOverAndOverIsRefused) {
  Dataset dataset = analyticDataset(24, 40);
  for (PosedView& view : dataset.views) view.rgba = dataset.views[0].rgba;
  expectRefused(dataset, "only 1 differ");
}

TEST(DataCheck, OnePoseForAllPhotosIsRefused) {
  Dataset dataset = analyticDataset(24, 40);
  for (PosedView& view : dataset.views) view.T_O_C = dataset.views[0].T_O_C;
  expectRefused(dataset, "1 different poses");
}

TEST(DataCheck, AModelOfPosesOfOtherPhotosIsNotUsable) {
  const Dataset right = analyticDataset(24, 40);
  Dataset dataset = right;
  for (std::size_t i = 0; i < 24; ++i) dataset.views[i].rgba = right.views[(7 * i + 5) % 24].rgba;
  dataset.has_box = true;
  dataset.box_min = Eigen::Vector3d::Constant(-0.6);
  dataset.box_max = Eigen::Vector3d::Constant(0.6);
  const auto backend = makeCpuBackend(2);
  RegistrationOptions settings = fewSteps();
  settings.accept_poor_data = true;
  settings.keep_colours = true;
  const Field field = learnField(backend.get(), dataset, settings, {}, {});
  expectError<std::runtime_error>([&] { requireUsableModel(field.metadata, 12); },
                                  "poses belong to the photos", "accept_poor_data");
}

}  // namespace
}  // namespace nerf_pose_refiner
