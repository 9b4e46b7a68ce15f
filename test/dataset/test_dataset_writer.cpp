// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/dataset_writer.h"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>

#include <filesystem>
#include <memory>
#include <stdexcept>

#include "dataset/dataset.h"
#include "support/expect_error.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

const Camera kCamera = {8, 6, 10, 11, 3.4, 2.6};

DatasetHeader header() {
  DatasetHeader result;
  result.camera = kCamera;
  return result;
}

Pose somePose(double angle) { return {expSO3({0.1, angle, -0.2}), {0.3, -0.4, 0.5 + angle}}; }

TEST(DatasetWriter, TheLoaderReadsWhatWasWritten) {
  const TemporaryFolder folder;
  const std::string path = folder.file("sets/mug");
  DatasetHeader boxed = header();
  boxed.has_box = true;
  boxed.box_min = {-0.1, -0.2, -0.3};
  boxed.box_max = {0.1, 0.2, 0.3};
  DatasetWriter writer(path, boxed);
  writer.add(Image8(8, 6, 3, 50), somePose(0.2));
  writer.add(Image8(8, 6, 3, 70), somePose(-0.3));
  EXPECT_EQ(writer.views(), 2);
  writer.finish();

  const Dataset dataset = loadDataset(path);
  ASSERT_EQ(dataset.views.size(), 2u);
  EXPECT_FALSE(dataset.has_alpha);
  EXPECT_EQ(dataset.metres_per_unit, 1);
  EXPECT_TRUE(dataset.has_box);
  EXPECT_EQ(dataset.box_min, boxed.box_min);
  EXPECT_EQ(dataset.box_max, boxed.box_max);
  const PosedView& view = dataset.views[1];
  EXPECT_EQ(view.rgba->values[0], 70);
  EXPECT_TRUE(view.T_O_C.R.isApprox(somePose(-0.3).R, 1e-12));
  EXPECT_TRUE(view.T_O_C.t.isApprox(somePose(-0.3).t, 1e-12));
  EXPECT_NEAR(view.camera.fx, 10, 1e-12);
  EXPECT_NEAR(view.camera.fy, 11, 1e-12);
  EXPECT_NEAR(view.camera.cx, 3.4, 1e-12);
  EXPECT_NEAR(view.camera.cy, 2.6, 1e-12);
}

TEST(DatasetWriter, AlphaAndDistortionComeBack) {
  const TemporaryFolder folder;
  DatasetHeader bent = header();
  bent.distortion.coefficients = {0.01, -0.002, 0.0003, 0.0004, 0.00005};
  DatasetWriter writer(folder.file("mug"), bent);
  Image8 image(8, 6, 4, 90);
  image.at(0, 0, 3) = 0;
  writer.add(image, somePose(0));
  writer.finish();
  const Dataset dataset = loadDataset(folder.file("mug"));
  EXPECT_TRUE(dataset.has_alpha);
  const std::vector<double> read = dataset.views[0].distortion.coefficients;
  ASSERT_EQ(read.size(), 8u);
  for (std::size_t i = 0; i < 5; ++i) EXPECT_EQ(read[i], bent.distortion.coefficients[i]);
}

TEST(DatasetWriter, AFisheyeLensComesBack) {
  const TemporaryFolder folder;
  DatasetHeader fisheye = header();
  fisheye.distortion = {{0.01, -0.002, 0.0003, 0.0004}, Distortion::Model::kFisheye};
  DatasetWriter writer(folder.file("mug"), fisheye);
  writer.add(Image8(8, 6, 3, 90), somePose(0));
  const Camera other = {4, 5, 6, 7, 2, 2};
  expectError<std::invalid_argument>([&] { writer.add(Image8(4, 5, 3), somePose(0), other); },
                                     "distortion");
  writer.finish();
  EXPECT_EQ(loadDataset(folder.file("mug")).views[0].distortion, fisheye.distortion);
}

TEST(DatasetWriter, EachViewMayHaveItsOwnCamera) {
  const TemporaryFolder folder;
  DatasetHeader unscaled = header();
  unscaled.metres_per_unit = 0;
  DatasetWriter writer(folder.file("mug"), unscaled);
  const Camera other = {4, 5, 6, 7, 2.5, 1.5};
  writer.add(Image8(8, 6, 3, 90), somePose(0));
  writer.add(Image8(4, 5, 3, 90), somePose(1), other);
  expectError<std::invalid_argument>([&] { writer.add(Image8(8, 6, 3), somePose(0), other); },
                                     "size");
  writer.finish();
  const Dataset dataset = loadDataset(folder.file("mug"));
  EXPECT_EQ(dataset.views[1].camera, other);
  EXPECT_NEAR(dataset.views[0].camera.cx, kCamera.cx, 1e-12);
  EXPECT_EQ(dataset.metres_per_unit, 0);
}

TEST(DatasetWriter, NothingAppearsBeforeTheEnd) {
  const TemporaryFolder folder;
  const std::string path = folder.file("mug");
  {
    DatasetWriter writer(path, header());
    writer.add(Image8(8, 6, 3, 50), somePose(0));
    EXPECT_FALSE(fs::exists(path));
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(DatasetWriter, WhatAKilledOneLeftIsRemoved) {
  const TemporaryFolder folder;
  folder.write(".mug.unfinished/view_0007.png", "rubbish");
  DatasetWriter writer(folder.file("mug"), header());
  writer.add(Image8(8, 6, 3, 50), somePose(0));
  writer.finish();
  EXPECT_FALSE(fs::exists(folder.file("mug/view_0007.png")));
  EXPECT_FALSE(fs::exists(folder.path() + "/.mug.unfinished"));
}

TEST(DatasetWriter, OneOfAFolderWorksAtATime) {
  const TemporaryFolder folder;
  const std::string path = folder.file("mug");
  {
    DatasetWriter first(path, header());
    first.add(Image8(8, 6, 3, 50), somePose(0));
    expectError<std::runtime_error>([&] { DatasetWriter(path, header()); }, "mug",
                                    "being written by somebody else");
    DatasetWriter other(folder.file("cup"), header());
    first.add(Image8(8, 6, 3, 70), somePose(0.1));
    first.finish();
    EXPECT_EQ(loadDataset(path).views.size(), 2u);
  }
  EXPECT_FALSE(fs::exists(folder.path() + "/.cup.unfinished"));
  DatasetWriter(folder.file("cup"), header());  // the one before is gone
}

TEST(DatasetWriter, ATargetThatAppearsMeanwhileCostsNoView) {
  const TemporaryFolder folder;
  const std::string path = folder.file("mug");
  DatasetWriter writer(path, header());
  writer.add(Image8(8, 6, 3, 50), somePose(0));
  folder.write("mug/transforms.json", "another's");
  folder.write("mug_2", "a file");
  EXPECT_EQ(writer.finish(), path + "_3");
  EXPECT_EQ(readFile(path + "/transforms.json"), "another's");
  EXPECT_EQ(readFile(path + "_2"), "a file");
  EXPECT_EQ(loadDataset(path + "_3").views.size(), 1u);
}

TEST(DatasetWriter, AFullDiskCostsNoViewThatIsWritten) {
  const TemporaryFolder folder;
  DatasetWriter writer(folder.file("mug"), header());
  writer.add(Image8(8, 6, 3, 50), somePose(0));
  rlimit before;
  getrlimit(RLIMIT_FSIZE, &before);
  const auto ignored = signal(SIGXFSZ, SIG_IGN);
  const rlimit little = {10, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &little);
  expectError<std::runtime_error>([&] { writer.add(Image8(8, 6, 3, 60), somePose(0.1)); },
                                  "view_0001.png", "File too large");
  expectError<std::runtime_error>([&] { writer.finish(); }, "transforms.json", "File too large");
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, ignored);
  EXPECT_EQ(writer.views(), 1);
  writer.add(Image8(8, 6, 3, 70), somePose(0.2));
  writer.finish();
  const Dataset dataset = loadDataset(folder.file("mug"));
  ASSERT_EQ(dataset.views.size(), 2u);
  EXPECT_EQ(dataset.views[1].rgba->values[0], 70);
}

TEST(DatasetWriter, RefusesWhatMakesNoSense) {
  const TemporaryFolder folder;
  folder.write("there/file", "x");
  expectError<std::runtime_error>([&] { DatasetWriter(folder.path() + "/there", header()); },
                                  "there already");
  DatasetWriter writer(folder.file("mug"), header());
  expectError<std::runtime_error>([&] { writer.finish(); }, "no views");
  expectError<std::invalid_argument>([&] { writer.add(Image8(8, 5, 3), somePose(0)); },
                                     "camera's size");
  Pose skew = somePose(0);
  skew.R *= 2;
  expectError<std::invalid_argument>([&] { writer.add(Image8(8, 6, 3), skew); }, "rigid");
  DatasetHeader empty_box = header();
  empty_box.has_box = true;
  expectError<std::invalid_argument>([&] { DatasetWriter(folder.file("box"), empty_box); }, "box");
}

}  // namespace
}  // namespace nerf_pose_refiner
