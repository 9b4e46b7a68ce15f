// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <stdexcept>

#include "dataset/dataset.h"
#include "image/io.h"
#include "support/colmap_files.h"
#include "support/expect_error.h"
#include "support/temporary_folder.h"

// COLMAP projects as its users have them.

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

/// A project of two photos of 8 x 6 pixels.
class ColmapFolder : public testing::Test {
 protected:
  ColmapFolder() { writePhotos("images"); }

  void writePhotos(const std::string& path, int channels = 3) const {
    for (const ColmapTestImage& image : images) {
      writePng(Image8(8, 6, channels, 90), folder.file(path + "/" + image.name));
    }
  }

  void writeModel(const std::string& path) const {
    folder.write(path + "/cameras.bin", camerasBinary(cameras));
    folder.write(path + "/images.bin", imagesBinary(images));
    folder.write(path + "/points3D.bin", pointsBinary(points));
  }

  /// The whole project, moved into a folder of its own.
  Dataset load(const DatasetOptions& options = {}) const {
    return loadDataset(folder.path(), options);
  }

  static bool hasNote(const Dataset& dataset, const std::string& part) {
    return std::any_of(dataset.notes.begin(), dataset.notes.end(), [&](const std::string& note) {
      return note.find(part) != std::string::npos;
    });
  }

  TemporaryFolder folder;
  std::vector<ColmapTestCamera> cameras = {{3, 1, "PINHOLE", 8, 6, {20, 21, 4.5, 3.5}}};
  std::vector<ColmapTestImage> images = {{1, {1, 0, 0, 0, 0, 0, 4}, 3, "a.png", 2},
                                         {2, {0, 0, 1, 0, 0, 0, 5}, 3, "left/b.png", 0}};
  std::vector<ColmapTestPoint> points = {{{-1, -1, -1}, {9, 9, 9}, 0.5, 3},
                                         {{1, 2, 3}, {9, 9, 9}, 0.5, 3},
                                         {{50, 50, 50}, {9, 9, 9}, 0.5, 2}};  // of two rays
};

TEST_F(ColmapFolder, PosesCamerasAndPoints) {
  writeModel("sparse/0");
  const Dataset dataset = load();
  ASSERT_EQ(dataset.views.size(), 2u);
  const PosedView& view = dataset.views[0];
  EXPECT_EQ(view.T_O_C.t, Eigen::Vector3d(0, 0, -4));
  EXPECT_EQ(view.camera.fx, 20);
  EXPECT_EQ(view.camera.cx, 4);  // counted from the centre of the first pixel
  // (1, 0.5, 0) is 4 in front of the camera: 20 * 1 / 4 + 4, 21 * 0.5 / 4 + 3.
  const Eigen::Vector2d pixel =
      view.camera.project(view.T_O_C.inverse() * Eigen::Vector3d(1, 0.5, 0));
  EXPECT_TRUE(pixel.isApprox(Eigen::Vector2d(9, 5.625))) << pixel.transpose();
  EXPECT_TRUE(dataset.views[1].T_O_C.t.isApprox(Eigen::Vector3d(0, 0, 5))) << "half a turn about y";
  ASSERT_EQ(dataset.points.size(), 3u);
  EXPECT_EQ(dataset.points[1].photos, 3u);
  EXPECT_EQ(dataset.metres_per_unit, 0);
}

TEST_F(ColmapFolder, TheBoxOfThePointsIsUsedWithoutAnyOther) {
  writeModel("sparse/0");
  Dataset dataset = load();
  EXPECT_TRUE(dataset.has_box);
  EXPECT_TRUE(dataset.box_min.isApprox(Eigen::Vector3d(-1.1, -1.15, -1.2)));
  EXPECT_TRUE(dataset.box_max.isApprox(Eigen::Vector3d(1.1, 2.15, 3.2)));
  EXPECT_TRUE(hasNote(dataset, "box of the scene's points"));
  for (ColmapTestPoint& point : points) point.track = 2;  // none is reliable: all count
  writeModel("sparse/0");
  EXPECT_GT(load().box_max.x(), 50);
  points.clear();
  writeModel("sparse/0");
  EXPECT_FALSE(load().has_box);
}

TEST_F(ColmapFolder, AlphaNeedsNoBox) {
  Image8 half(8, 6, 4, 200);
  for (const ColmapTestImage& image : images) {
    writePng(half, folder.file("images/" + image.name));
  }
  writeModel("sparse/0");
  EXPECT_FALSE(load().has_box);
}

TEST_F(ColmapFolder, Layouts) {
  for (const std::string model : {"sparse/0", "sparse", "colmap/sparse/0", "."}) {
    writeModel(model);
    EXPECT_EQ(load().views.size(), 2u) << model;
    for (const char* name : {"cameras", "images", "points3D"}) {
      fs::remove(folder.file(model + "/" + name + ".bin"));
    }
  }
  expectError<std::runtime_error>([this] { load(); }, folder.path(), "COLMAP", "transforms.json");
}

TEST_F(ColmapFolder, ThePhotosMayBeBesideTheModel) {
  fs::remove_all(folder.file("images"));
  writePhotos(".");
  writeModel("sparse/0");
  EXPECT_EQ(load().views.size(), 2u);
}

TEST_F(ColmapFolder, UndistortedPhotosIfTheOthersAreGone) {
  writeModel("sparse/0");
  cameras[0].parameters[0] = 30;
  writeModel("dense/0/sparse");
  writePhotos("dense/0/images");
  EXPECT_EQ(load().views[0].camera.fx, 20);
  fs::remove_all(folder.file("images"));
  EXPECT_EQ(load().views[0].camera.fx, 30);
}

// What the user names may be the model's own folder, unless the dataset is confined to it.
TEST_F(ColmapFolder, TheModelsOwnFolder) {
  writeModel("sparse/0");
  for (const char* path : {"sparse", "sparse/0"}) {
    EXPECT_EQ(loadDataset(folder.file(path)).views.size(), 2u) << path;
  }
  DatasetOptions options;
  options.confined = true;
  EXPECT_EQ(load(options).views.size(), 2u);
  expectError<std::runtime_error>([&] { loadDataset(folder.file("sparse/0"), options); },
                                  "are not there", "images");
}

TEST_F(ColmapFolder, TheLargestOfSeveralModels) {
  writeModel("sparse/1");
  const std::vector<ColmapTestImage> both = images;
  images.pop_back();
  writeModel("sparse/0");
  writeModel("sparse/2");
  const Dataset dataset = load();
  EXPECT_EQ(dataset.views.size(), 2u);
  EXPECT_TRUE(hasNote(dataset, "'sparse/1' with 2 photos"));
  EXPECT_TRUE(hasNote(dataset, "'sparse/0' (1), 'sparse/2' (1)"));
}

TEST_F(ColmapFolder, RigsAndFramesSayNothingNew) {
  writeModel("sparse/0");
  folder.write("sparse/0/rigs.bin", "of version 3.12");
  folder.write("sparse/0/frames.bin", "and later");
  EXPECT_EQ(load().views.size(), 2u);
}

TEST_F(ColmapFolder, BinaryBeforeText) {
  writeModel("sparse/0");
  folder.write("sparse/0/cameras.txt", "3 PINHOLE 8 6 40 41 4.5 3.5\n");
  folder.write("sparse/0/images.txt",
               "1 1 0 0 0 0 0 4 3 a.png\n1.5 2.5 -1\n2 0 0 1 0 0 0 5 3 left/b.png\n\n");
  folder.write("sparse/0/points3D.txt", "7 1 2 3 9 9 9 0.5 1 0 2 0\n");
  EXPECT_EQ(load().views[0].camera.fx, 20);
  fs::remove(folder.file("sparse/0/images.bin"));
  const Dataset text = load();
  ASSERT_EQ(text.views.size(), 2u);
  EXPECT_EQ(text.views[0].camera.fx, 40);
  EXPECT_EQ(text.points.size(), 1u);
}

TEST_F(ColmapFolder, PhotosWithoutPoseAreNamed) {
  writeModel("sparse/0");
  writePng(Image8(8, 6, 3, 90), folder.file("images/blurred.png"));
  EXPECT_TRUE(hasNote(load(), "1 of 3 photos have no pose and are left out: blurred.png."));
}

TEST_F(ColmapFolder, Masks) {
  writeModel("sparse/0");
  Image8 mask(8, 6, 1, 0);
  mask.at(2, 3, 0) = 255;
  for (const std::string name : {"a.png.png", "left/b.png.png"}) {
    writePng(mask, folder.file("masks/" + name));
  }
  const Dataset dataset = load();
  EXPECT_TRUE(dataset.has_masks);
  EXPECT_FALSE(dataset.has_box);
  EXPECT_EQ(dataset.views[1].rgba->at(2, 3, 3), 255);
  EXPECT_EQ(dataset.views[1].rgba->at(1, 3, 3), 0);
  fs::remove(folder.file("masks/left/b.png.png"));
  expectError<std::runtime_error>([this] { load(); }, "left/b.png",
                                  "neither alpha channel nor mask");
  writePng(mask, folder.file("masks/left/b.png"));
  EXPECT_TRUE(load().has_masks);
}

TEST_F(ColmapFolder, EachPhotoItsOwnCamera) {
  cameras.push_back({4, 5, "OPENCV_FISHEYE", 8, 6, {5, 5, 4, 3, 0.01, 0, 0, 0}});
  images[1].camera = 4;
  writeModel("sparse/0");
  const Dataset dataset = load();
  EXPECT_TRUE(dataset.views[0].distortion.isZero());
  EXPECT_EQ(dataset.views[1].distortion.model, Distortion::Model::kFisheye);
  EXPECT_EQ(dataset.views[1].photo_camera.fx, 5);
  EXPECT_NE(dataset.views[1].camera.fx, 5);
}

TEST_F(ColmapFolder, WhatIsMissingIsNamed) {
  images[1].camera = 8;
  writeModel("sparse/0");
  expectError<std::runtime_error>([this] { load(); }, "sparse/0/images.bin", "left/b.png",
                                  "no camera 8");
  images[1].camera = 3;
  images[1].name = "left/c.png";
  writeModel("sparse/0");
  expectError<std::runtime_error>([this] { load(); }, "left/c.png", "no file");
  images[0].name = "gone.png";
  writeModel("sparse/0");
  expectError<std::runtime_error>([this] { load(); }, "'sparse/0'", "are not there", "images");
  images.clear();
  writeModel("sparse/0");
  expectError<std::runtime_error>([this] { load(); }, "images.bin", "no photo has a pose");
  folder.write("sparse/0/images.bin", "short");
  expectError<std::runtime_error>([this] { load(); }, "sparse/0/images.bin", "ends too soon");
}

TEST_F(ColmapFolder, AConfinedProjectReadsNothingElsewhere) {
  DatasetOptions options;
  options.confined = true;
  const std::string project = folder.path() + "/project";
  writePng(Image8(8, 6, 3, 90), folder.file("secret.png"));
  writePhotos("project/images");
  writeModel("project/sparse/0");
  EXPECT_EQ(loadDataset(project, options).views.size(), 2u);
  for (const std::string& name : {std::string("../../secret.png"), folder.file("secret.png")}) {
    images[1].name = name;
    writeModel("project/sparse/0");
    EXPECT_NO_THROW(loadDataset(project)) << "a tool may read anywhere";
    expectError<std::runtime_error>([&] { loadDataset(project, options); }, "secret.png");
  }
  fs::rename(project + "/sparse/0", folder.path() + "/elsewhere");
  fs::create_directory_symlink(folder.path() + "/elsewhere", project + "/sparse/0");
  EXPECT_THROW(loadDataset(project, options), std::exception);
}

}  // namespace
}  // namespace nerf_pose_refiner
