// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <stdexcept>

#include "dataset/dataset.h"
#include "image/io.h"
#include "support/expect_error.h"
#include "support/temporary_folder.h"

// What nerfstudio's transforms.json has beyond instant-ngp's.

namespace nerf_pose_refiner {
namespace {

using Json = nlohmann::json;

/// Three frames of 16 x 12 pixels.
class Nerfstudio : public testing::Test {
 protected:
  Nerfstudio() {
    scene = {{"w", 16},    {"h", 12},    {"fl_x", 8},
             {"fl_y", 8},  {"cx", 8},    {"cy", 6},
             {"k1", 0.01}, {"k2", 0.02}, {"camera_model", "OPENCV_FISHEYE"}};
    for (const char* name : {"images/1.png", "images/2.png", "images/3.png"}) {
      writePng(Image8(16, 12, 4, 200), folder.file(name));
      const double z = 2.0 + static_cast<double>(scene["frames"].size());
      scene["frames"].push_back(
          {{"file_path", name},
           {"depth_file_path", "depth/none.png"},  // never opened
           {"transform_matrix", {{1, 0, 0, 1}, {0, 1, 0, 0}, {0, 0, 1, z}, {0, 0, 0, 1}}}});
    }
  }

  Dataset load() const { return loadDataset(folder.write("transforms.json", scene.dump())); }

  template <typename... Parts>
  void expectRefused(const Parts&... parts) const {
    expectError<std::runtime_error>([this] { load(); }, folder.file("transforms.json"), parts...);
  }

  TemporaryFolder folder;
  Json scene;
};

TEST_F(Nerfstudio, FisheyeLens) {
  scene["k3"] = 0.003;
  scene["k4"] = 0.004;
  const Dataset dataset = load();
  EXPECT_EQ(dataset.views[0].distortion,
            (Distortion{{0.01, 0.02, 0.003, 0.004}, Distortion::Model::kFisheye}));
  EXPECT_EQ(dataset.views[0].photo_camera.fx, 8);
  scene.erase("camera_model");
  scene["is_fisheye"] = true;  // as instant-ngp says it
  EXPECT_EQ(load().views[0].distortion, dataset.views[0].distortion);
  scene["k1"] = -5;
  expectRefused("frame 0", "folds");
}

TEST_F(Nerfstudio, CoefficientsAsAList) {
  for (const char* key : {"k1", "k2"}) scene.erase(key);
  scene["distortion_params"] = {0.1, 0.2, 0.3, 0.4, 0.5, 0.6};
  EXPECT_EQ(load().views[0].distortion.coefficients, (std::vector<double>{0.1, 0.2, 0.3, 0.4}));
  scene["camera_model"] = "OPENCV";
  scene["distortion_params"] = {0.01, 0.02, 0, 0, 0.005, 0.006};
  EXPECT_EQ(load().views[0].distortion.coefficients,
            (std::vector<double>{0.01, 0.02, 0.005, 0.006, 0, 0, 0, 0}));
  scene["distortion_params"] = {0.1, 0.2};
  expectRefused("frame 0", "distortion_params", "6 numbers");
}

// x_file = 2 (A x + t), with A turning x to y: undone, the poses are those of the source again.
TEST_F(Nerfstudio, PosesAreThoseBeforeItsTransform) {
  const Pose file = load().views[0].T_O_C;
  scene["applied_transform"] = {{0, -1, 0, 0}, {1, 0, 0, 0}, {0, 0, 1, 0.5}};
  scene["applied_scale"] = 2.0;
  scene["metres_per_unit"] = 0.1;
  scene["aabb"] = {{0, 0, 0}, {2, 4, 6}};
  const Dataset dataset = load();
  // (1, 0, 2) of the file: / 2 = (0.5, 0, 1), - t = (0.5, 0, 0.5), turned back = (0, -0.5, 0.5).
  EXPECT_TRUE(dataset.views[0].T_O_C.t.isApprox(Eigen::Vector3d(0, -0.5, 0.5)));
  EXPECT_TRUE((dataset.views[0].T_O_C.R.col(0)).isApprox(Eigen::Vector3d(0, -1, 0)));
  EXPECT_EQ(file.R.col(0), Eigen::Vector3d(1, 0, 0));
  EXPECT_DOUBLE_EQ(dataset.metres_per_unit, 0.2) << "a unit of the source is two of the file";
  EXPECT_TRUE(dataset.box_min.isApprox(Eigen::Vector3d(0, -1, -0.5)));
  EXPECT_TRUE(dataset.box_max.isApprox(Eigen::Vector3d(2, 0, 2.5)));
}

TEST_F(Nerfstudio, TransformsThatMakeNoSense) {
  scene["applied_scale"] = 0;
  expectRefused("applied_scale", "not positive");
  scene.erase("applied_scale");
  scene["applied_transform"] = {{0, -2, 0, 0}, {1, 0, 0, 0}, {0, 0, 1, 0.5}};
  expectRefused("applied_transform", "not rigid");
  scene["applied_transform"] = {1, 2, 3};
  expectRefused("row 0 of applied_transform");
}

TEST_F(Nerfstudio, SplitLists) {
  scene["train_filenames"] = {"./images/1.png", "images/3.png"};
  scene["val_filenames"] = scene["test_filenames"] = {"images/2.png"};
  Dataset dataset = load();
  ASSERT_EQ(dataset.views.size(), 2u);
  EXPECT_EQ(dataset.views[1].T_O_C.t.z(), 4);
  ASSERT_EQ(dataset.notes.size(), 1u);
  EXPECT_NE(dataset.notes[0].find("2 of 3 frames"), std::string::npos) << dataset.notes[0];
  scene.erase("train_filenames");
  EXPECT_EQ(load().views.size(), 2u);
  scene["train_filenames"] = {"images/9.png"};
  expectRefused("train_filenames", "images/9.png");
  scene["train_filenames"] = Json::array();
  expectRefused("no frame for training");
  scene["train_filenames"] = "images/1.png";
  expectRefused("train_filenames is not a list");
}

TEST_F(Nerfstudio, CamerasOfOtherKinds) {
  for (const char* model : {"EQUIRECTANGULAR", "FISHEYE624", "ORTHOPHOTO"}) {
    scene["camera_model"] = model;
    expectRefused("frame 0", model, "not supported");
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
