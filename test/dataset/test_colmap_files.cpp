// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "dataset/colmap_binary.h"
#include "dataset/colmap_text.h"
#include "support/colmap_files.h"
#include "support/expect_error.h"
#include "support/temporary_folder.h"

// The files of a COLMAP model.

namespace nerf_pose_refiner {
namespace {

constexpr auto kFisheye = Distortion::Model::kFisheye;

/// Of each model that is read, and what becomes of its parameters.
struct LensCase {
  ColmapTestCamera camera;
  double fy, cx;
  Distortion distortion;
};

const std::vector<LensCase> kLenses = {
    {{1, 0, "SIMPLE_PINHOLE", 80, 60, {50, 41, 31}}, 50, 41, {}},
    {{2, 1, "PINHOLE", 80, 60, {50, 51, 41, 31}}, 51, 41, {}},
    {{3, 2, "SIMPLE_RADIAL", 80, 60, {50, 41, 31, 0.1}}, 50, 41, {{0.1, 0, 0, 0}}},
    {{4, 3, "RADIAL", 80, 60, {50, 41, 31, 0.1, 0.2}}, 50, 41, {{0.1, 0.2, 0, 0}}},
    {{5, 4, "OPENCV", 80, 60, {50, 51, 41, 31, 1, 2, 3, 4}}, 51, 41, {{1, 2, 3, 4}}},
    {{6, 5, "OPENCV_FISHEYE", 80, 60, {50, 51, 41, 31, 1, 2, 3, 4}},
     51,
     41,
     {{1, 2, 3, 4}, kFisheye}},
    {{7, 6, "FULL_OPENCV", 80, 60, {50, 51, 41, 31, 1, 2, 3, 4, 5, 6, 7, 8}},
     51,
     41,
     {{1, 2, 3, 4, 5, 6, 7, 8}}},
    {{8, 8, "SIMPLE_RADIAL_FISHEYE", 80, 60, {50, 41, 31, 0.1}},
     50,
     41,
     {{0.1, 0, 0, 0}, kFisheye}},
    {{9, 9, "RADIAL_FISHEYE", 80, 60, {50, 41, 31, 0.1, 0.2}},
     50,
     41,
     {{0.1, 0.2, 0, 0}, kFisheye}},
    {{10, 14, "SIMPLE_FISHEYE", 80, 60, {50, 41, 31}}, 50, 41, {{0, 0, 0, 0}, kFisheye}},
    {{11, 15, "FISHEYE", 80, 60, {50, 51, 41, 31}}, 51, 41, {{0, 0, 0, 0}, kFisheye}},
};

void expectLenses(const ColmapCameras& cameras) {
  ASSERT_EQ(cameras.size(), kLenses.size());
  for (const LensCase& lens : kLenses) {
    const ColmapCamera& camera = cameras.at(lens.camera.id);
    EXPECT_EQ(camera.width, 80) << lens.camera.model_name;
    EXPECT_EQ(camera.height, 60) << lens.camera.model_name;
    EXPECT_EQ(camera.fx, 50) << lens.camera.model_name;
    EXPECT_EQ(camera.fy, lens.fy) << lens.camera.model_name;
    EXPECT_EQ(camera.cx, lens.cx) << lens.camera.model_name;
    EXPECT_EQ(camera.cy, 31) << lens.camera.model_name;
    EXPECT_EQ(camera.distortion, lens.distortion) << lens.camera.model_name;
  }
}

/// A quarter turn about z: the camera's x is the world's -y, and its centre is at (2, -1, -3).
const ColmapTestImage kTurned = {
    4, {std::sqrt(0.5), 0, 0, std::sqrt(0.5), -1, -2, 3}, 9, "left/b c.jpg", 3};

void expectTurned(const ColmapImage& image) {
  EXPECT_EQ(image.name, "left/b c.jpg");
  EXPECT_EQ(image.camera, 9u);
  const Pose T_O_C = image.T_C_O.inverse();
  EXPECT_TRUE(T_O_C.t.isApprox(Eigen::Vector3d(2, -1, -3), 1e-12)) << T_O_C.t.transpose();
  EXPECT_TRUE(T_O_C.R.col(0).isApprox(Eigen::Vector3d(0, -1, 0), 1e-12)) << T_O_C.R;
}

class ColmapBinary : public testing::Test {
 protected:
  /// Calls a reader with a file of that content.
  template <typename Reader>
  auto read(const std::string& content, const Reader& reader) const {
    return reader(InputFile(folder.write("model.bin", content)));
  }
  ColmapCameras cameras(const std::string& content) const {
    return read(content, readColmapCamerasBinary);
  }
  std::vector<ColmapImage> images(const std::string& content) const {
    return read(content,
                [this](const InputFile& file) { return readColmapImagesBinary(file, limits); });
  }
  std::vector<ScenePoint> points(const std::string& content) const {
    return read(content,
                [this](const InputFile& file) { return readColmapPointsBinary(file, limits); });
  }

  TemporaryFolder folder;
  DatasetLimits limits;
  const std::string two_images =
      imagesBinary({{1, {2, 0, 0, 0, 0.5, 0, 4}, 1, "a.jpg", 0}, kTurned});
  const std::string two_points =
      pointsBinary({{{1, 2, 3}, {10, 20, 255}, 0.25, 4}, {{-1, 0, 0}, {0, 0, 0}, 1, 2}});
};

TEST_F(ColmapBinary, Cameras) {
  std::vector<ColmapTestCamera> list;
  for (const LensCase& lens : kLenses) list.push_back(lens.camera);
  expectLenses(cameras(camerasBinary(list)));
}

TEST_F(ColmapBinary, ImagesAndTheirKeypoints) {
  const std::vector<ColmapImage> list = images(two_images);
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0].name, "a.jpg");
  EXPECT_TRUE(list[0].T_C_O.R.isIdentity(1e-12)) << "quaternions are of any length";
  EXPECT_EQ(list[0].T_C_O.t, Eigen::Vector3d(0.5, 0, 4));
  expectTurned(list[1]);
  EXPECT_EQ(countColmapImagesBinary(InputFile(folder.file("model.bin"))), 2u);
}

TEST_F(ColmapBinary, Points) {
  const std::vector<ScenePoint> list = points(two_points);
  ASSERT_EQ(list.size(), 2u);
  EXPECT_EQ(list[0].position_O, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(list[0].rgb, (std::array<std::uint8_t, 3>{10, 20, 255}));
  EXPECT_EQ(list[0].error_px, 0.25);
  EXPECT_EQ(list[0].photos, 4u);
  EXPECT_EQ(list[1].position_O.x(), -1);
}

TEST_F(ColmapBinary, ManyKeypointsAreSkipped) {
  ColmapTestImage many = kTurned;
  many.keypoints = 20000;  // more than is buffered
  const std::vector<ColmapImage> list = images(imagesBinary({many, kTurned}));
  ASSERT_EQ(list.size(), 2u);
  expectTurned(list[1]);
}

TEST_F(ColmapBinary, EveryCutIsNoticed) {
  const std::string two_cameras = camerasBinary({kLenses[0].camera, kLenses[6].camera});
  for (std::size_t n = 0; n < two_cameras.size(); ++n) {
    EXPECT_THROW(cameras(two_cameras.substr(0, n)), std::runtime_error) << n;
  }
  for (std::size_t n = 0; n < two_images.size(); ++n) {
    EXPECT_THROW(images(two_images.substr(0, n)), std::runtime_error) << n;
  }
  for (std::size_t n = 0; n < two_points.size(); ++n) {
    EXPECT_THROW(points(two_points.substr(0, n)), std::runtime_error) << n;
  }
  for (const std::string& text : {two_cameras, two_images, two_points}) {
    EXPECT_THROW(cameras(text + '\0'), std::runtime_error);
  }
  expectError<std::runtime_error>([&] { images(two_images + "x"); }, "goes on behind");
}

// The counts are checked against the size of the file before anything is allocated.
TEST_F(ColmapBinary, CountsThatTheFileCannotHold) {
  const std::string huge = Bytes().add<std::uint64_t>(std::uint64_t{1} << 60).content();
  const std::string rest(200, '\0');
  expectError<std::runtime_error>([&] { cameras(huge + rest); }, "ends too soon");
  expectError<std::runtime_error>([&] { images(huge + rest); }, "ends too soon");
  expectError<std::runtime_error>([&] { points(huge + rest); }, "ends too soon");
  ColmapTestImage image = kTurned;
  image.keypoints = 0;
  std::string content = imagesBinary({image});
  content.replace(content.size() - 8, 8, huge);
  expectError<std::runtime_error>([&] { images(content); }, "ends too soon");
}

TEST_F(ColmapBinary, Limits) {
  limits.frames = 1;
  expectError<std::runtime_error>([&] { images(two_images); }, "2 photos", "at most 1");
  limits.points = 1;
  expectError<std::runtime_error>([&] { points(two_points); }, "2 points", "at most 1");
  limits.model_bytes = 100;
  expectError<std::runtime_error>([&] { images(two_images); }, "at most 100");
}

TEST_F(ColmapBinary, WhatMakesNoSense) {
  const auto camera = [&](int model, const std::vector<double>& parameters) {
    return [=] { cameras(camerasBinary({{1, model, "", 80, 60, parameters}})); };
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  expectError<std::runtime_error>(camera(7, {50, 50, 40, 30, 1}), "FOV", "image_undistorter");
  expectError<std::runtime_error>(camera(99, {50, 40, 30}), "number 99");
  expectError<std::runtime_error>(camera(-1, {50, 40, 30}), "number -1");
  expectError<std::runtime_error>(camera(0, {-50, 40, 30}), "focal length", "positive");
  expectError<std::runtime_error>(camera(0, {50, nan, 30}), "not a finite number");
  ColmapTestImage image = kTurned;
  image.pose = {0, 0, 0, 0, 1, 2, 3};
  expectError<std::runtime_error>([&] { images(imagesBinary({image})); }, "quaternion");
  image.pose = {1, 0, 0, 0, nan, 2, 3};
  expectError<std::runtime_error>([&] { images(imagesBinary({image})); }, "not finite");
  image = kTurned;
  image.name.assign(5000, 'x');
  expectError<std::runtime_error>([&] { images(imagesBinary({image})); }, "4096 characters");
  const ColmapTestPoint point = {{nan, 0, 0}, {0, 0, 0}, 1, 0};
  expectError<std::runtime_error>([&] { points(pointsBinary({point})); }, "not finite");
}

TEST(ColmapText, Cameras) {
  std::string text = "# Camera list with one line of data per camera:\n";
  for (const LensCase& lens : kLenses) {
    text += std::to_string(lens.camera.id) + " " + lens.camera.model_name + " 80 60";
    for (const double p : lens.camera.parameters) text += " " + std::to_string(p);
    text += lens.camera.id % 2 ? "\n" : "\r\n";
  }
  expectLenses(readColmapCamerasText(text));
}

TEST(ColmapText, ImagesOfTwoLinesEach) {
  const std::string text =
      "# a comment\n\n"
      "1 1 0 0 0 0.5 0 4 1 a.jpg\n"
      "\n"  // no keypoints
      "4 0.7071067811865476 0 0 0.7071067811865476 -1 -2 3 9 left/b c.jpg\n"
      "1.5 2.5 -1 3 4 17\n";
  std::vector<ColmapImage> images = readColmapImagesText(text, {});
  ASSERT_EQ(images.size(), 2u);
  EXPECT_EQ(images[0].name, "a.jpg");
  expectTurned(images[1]);
  images = readColmapImagesText("7 1 0 0 0 0 0 0 1 last.jpg", {});  // cut behind the first line
  ASSERT_EQ(images.size(), 1u);
  EXPECT_EQ(images[0].name, "last.jpg");
}

TEST(ColmapText, Points) {
  const std::vector<ScenePoint> points =
      readColmapPointsText("# x\n63 1 2 3 10 20 255 0.25 16 6542 15 7345 6 6714\n", {});
  ASSERT_EQ(points.size(), 1u);
  EXPECT_EQ(points[0].position_O, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(points[0].rgb[2], 255);
  EXPECT_EQ(points[0].error_px, 0.25);
  EXPECT_EQ(points[0].photos, 3u);
}

TEST(ColmapText, ErrorsNameTheLine) {
  const auto camera = [](const std::string& line) {
    return [=] { readColmapCamerasText("# x\n" + line + "\n"); };
  };
  expectError<std::runtime_error>(camera("1 PINHOLE 80 60 50"), "line 2", "1 parameters", "4");
  expectError<std::runtime_error>(camera("1 PINHOLE 80"), "line 2", "HEIGHT");
  expectError<std::runtime_error>(camera("1 PINHOLE 80 60 50 51 here 31"), "not a number");
  expectError<std::runtime_error>(camera("1 FOV 80 60 50 51 41 31 1"), "line 2", "FOV");
  expectError<std::runtime_error>(camera("one PINHOLE"), "CAMERA_ID");
  expectError<std::runtime_error>([] { readColmapImagesText("1 0 0 0 0 1 2 3 1 a.jpg\n\n", {}); },
                                  "line 1", "quaternion");
  expectError<std::runtime_error>([] { readColmapImagesText("1 1 0 0 0 1\n", {}); }, "line 1");
  expectError<std::runtime_error>([] { readColmapPointsText("1 0 0 0 0 0 256 1\n", {}); }, "RGB");
  expectError<std::runtime_error>([] { readColmapPointsText("1 0 0 0 0 0 0 1 5\n", {}); }, "pairs");
  DatasetLimits limits;
  limits.frames = limits.points = 1;
  expectError<std::runtime_error>(
      [&] { readColmapImagesText("1 1 0 0 0 1 2 3 1 a\n\n1 1 0 0 0 1 2 3 1 b\n", limits); },
      "line 3", "more than 1 photos");
  expectError<std::runtime_error>(
      [&] { readColmapPointsText("1 0 0 0 0 0 0 1\n2 0 0 0 0 0 0 1\n", limits); }, "line 2",
      "more than 1 points");
}

}  // namespace
}  // namespace nerf_pose_refiner
