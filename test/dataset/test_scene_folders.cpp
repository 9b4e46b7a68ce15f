// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "dataset/dataset.h"
#include "image/io.h"
#include "support/expect_error.h"
#include "support/temporary_folder.h"

// Whole scene folders, each as the programs and people that make them lay them out; and what a
// folder may name that does not lie in it.

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// A camera at (0, 0, z) that looks at the origin: OpenGL axes, so -z is forward.
Json lookingDown(double z) { return {{1, 0, 0, 0}, {0, 1, 0, 0}, {0, 0, 1, z}, {0, 0, 0, 1}}; }

/// RGBA: an opaque square in the middle, transparent around it.
Image8 cutOut(int width, int height) {
  Image8 image(width, height, 4, 0);
  for (int y = height / 4; y < height - height / 4; ++y) {
    for (int x = width / 4; x < width - width / 4; ++x) {
      for (int c = 0; c < 4; ++c) image.at(x, y, c) = 255;
    }
  }
  return image;
}

class SceneFolder : public testing::Test {
 protected:
  TemporaryFolder folder;
};

// As Blender's script for NeRF Synthetic writes it: splits, no endings, an angle, RGBA.
TEST_F(SceneFolder, NerfSynthetic) {
  for (const std::string split : {"train", "test"}) {
    Json scene = {{"camera_angle_x", 0.6911112070083618}, {"frames", Json::array()}};
    for (int i = 0; i < 3; ++i) {
      const std::string name = "./" + split + "/r_" + std::to_string(i);
      writePng(cutOut(40, 40), folder.file(name + ".png"));
      scene["frames"].push_back({{"file_path", name},
                                 {"rotation", 0.012566370614359171},
                                 {"transform_matrix", lookingDown(4 + i)}});
    }
    folder.write("transforms_" + split + ".json", scene.dump());
  }
  // Depth images and the like lie beside them and are nobody's business.
  writePng(Image8(40, 40, 4, 0), folder.file("test/r_0_depth_0001.png"));
  const Dataset dataset = loadDataset(folder.path());
  ASSERT_EQ(dataset.views.size(), 3u);
  EXPECT_TRUE(dataset.has_alpha);
  EXPECT_FALSE(dataset.has_box);
  EXPECT_NEAR(dataset.views[2].camera.fx, 55.5555517, 1e-6);  // 20 / tan(0.34556)
  EXPECT_EQ(dataset.views[2].T_O_C.t, Eigen::Vector3d(0, 0, 6));
  EXPECT_EQ(dataset.views[0].rgba->at(0, 0, 3), 0);
  EXPECT_EQ(loadDataset(folder.file("transforms_test.json")).views.size(), 3u);
}

// As instant-ngp's scripts write it: pixels, lens, sizes with a point, aabb_scale; here from two
// cameras, so that each frame has intrinsics of its own, and with masks.
TEST_F(SceneFolder, InstantNgpWithIntrinsicsAndMasksOfEachFrame) {
  Json scene = {{"aabb_scale", 4}, {"frames", Json::array()}};
  for (int i = 0; i < 4; ++i) {
    const int width = i % 2 ? 60 : 40, height = i % 2 ? 40 : 30;
    const std::string number = "000" + std::to_string(i);
    writePng(Image8(width, height, 3, 90), folder.file("images/" + number + ".jpg"));
    Image8 mask(width, height, 1, 0);
    for (int x = width / 2; x < width; ++x) mask.at(x, 5, 0) = 255;
    writePng(mask, folder.file("masks/" + number + ".png"));
    scene["frames"].push_back({{"file_path", "./images/" + number + ".jpg"},
                               {"mask_path", "masks/" + number + ".png"},
                               {"sharpness", 31.7},
                               {"camera_model", i % 2 ? "OPENCV" : "PINHOLE"},
                               {"w", 1.0 * width},
                               {"h", 1.0 * height},
                               {"fl_x", 50.0 + i},
                               {"fl_y", 51.0 + i},
                               {"cx", width / 2.0 + 1},
                               {"cy", height / 2.0},
                               {"k1", i % 2 ? 0.02 : 0.0},
                               {"k2", 0.0},
                               {"p1", 0.0},
                               {"p2", 0.0},
                               {"transform_matrix", lookingDown(2 + i)}});
  }
  folder.write("transforms.json", scene.dump());
  const Dataset dataset = loadDataset(folder.path());
  ASSERT_EQ(dataset.views.size(), 4u);
  EXPECT_TRUE(dataset.has_alpha);
  const PosedView& straight = dataset.views[2];
  EXPECT_EQ(straight.camera.fx, 52);
  EXPECT_EQ(straight.camera.fy, 53);
  EXPECT_EQ(straight.camera.cx, 20.5);  // 21, counted from the corner
  EXPECT_EQ(straight.photo_camera.fx, 52);
  EXPECT_TRUE(straight.distortion.isZero());
  EXPECT_EQ(straight.rgba->at(19, 5, 3), 0);
  EXPECT_EQ(straight.rgba->at(20, 5, 3), 255);
  const PosedView& bent = dataset.views[3];
  EXPECT_EQ(bent.rgba->width, 60);
  EXPECT_EQ(bent.photo_camera.fx, 53);
  EXPECT_NE(bent.camera.fx, 53);  // undistorted
  ASSERT_FALSE(bent.distortion.isZero());
  EXPECT_EQ(bent.distortion.coefficients[0], 0.02);
}

// Photos without alpha or masks, and a box around the object.
TEST_F(SceneFolder, RgbInABox) {
  Json scene = {{"fl_x", 50},
                {"w", 40},
                {"h", 30},
                {"cx", 20},
                {"cy", 15},
                {"aabb", {{-0.5, -0.25, -1}, {0.5, 0.25, 1}}},
                {"frames", Json::array()},
                {"metres_per_unit", 0.1}};
  for (int i = 0; i < 2; ++i) {
    const std::string name = "IMG_" + std::to_string(i) + ".JPG";
    writePng(Image8(40, 30, 3, 90), folder.file(name));
    scene["frames"].push_back(
        {{"file_path", "IMG_" + std::to_string(i)}, {"transform_matrix", lookingDown(3)}});
  }
  folder.write("transforms.json", scene.dump());
  const Dataset dataset = loadDataset(folder.path());
  ASSERT_EQ(dataset.views.size(), 2u);
  EXPECT_FALSE(dataset.has_alpha);
  ASSERT_TRUE(dataset.has_box);
  EXPECT_EQ(dataset.box_max, Eigen::Vector3d(0.5, 0.25, 1));
  EXPECT_EQ(dataset.metres_per_unit, 0.1);
  EXPECT_EQ(dataset.views[1].rgba->at(7, 7, 3), 255);
}

// ---- what lies elsewhere ----

/// A folder with a scene, and a picture beside the folder.
class Confined : public SceneFolder {
 protected:
  Confined() {
    writePng(cutOut(8, 6), folder.file("scene/inside.png"));
    writePng(cutOut(8, 6), folder.file("secret.png"));
    options.confined = true;
  }

  /// @return the path of a scene with one frame.
  std::string scene(const std::string& picture, const std::string& mask = "") const {
    Json frame = {{"file_path", picture}, {"transform_matrix", lookingDown(2)}};
    if (!mask.empty()) frame["mask_path"] = mask;
    folder.write("scene/transforms.json",
                 Json{{"camera_angle_x", 1.0}, {"frames", {frame}}}.dump());
    return folder.path() + "/scene";
  }

  void expectRefused(const std::string& picture, const std::string& mask = "") const {
    const std::string path = scene(picture, mask);
    EXPECT_NO_THROW(loadDataset(path)) << "a tool may read anywhere";
    expectError<std::runtime_error>([&] { loadDataset(path, options); }, "frame 0",
                                    mask.empty() ? picture : mask);
  }

  DatasetOptions options;
};

TEST_F(Confined, ReadsWhatIsInside) {
  EXPECT_EQ(loadDataset(scene("inside.png", "./inside.png"), options).views.size(), 1u);
  EXPECT_EQ(loadDataset(scene("./inside"), options).views.size(), 1u);
  fs::create_symlink(folder.path() + "/scene/inside.png", folder.file("scene/link.png"));
  EXPECT_EQ(loadDataset(scene("link"), options).views.size(), 1u);
}

TEST_F(Confined, RefusesAbsolutePaths) {
  expectRefused(folder.path() + "/secret.png");
  expectRefused("inside.png", folder.path() + "/secret.png");
}

TEST_F(Confined, RefusesTheFolderAbove) {
  expectRefused("../secret.png");
  expectRefused("../secret");
  expectRefused("inside.png", "../secret.png");
}

TEST_F(Confined, RefusesLinksThatLeadOut) {
  fs::create_symlink(folder.path() + "/secret.png", folder.file("scene/link.png"));
  fs::create_directory_symlink(folder.path(), folder.file("scene/up"));
  expectRefused("link.png");
  expectRefused("link");
  expectRefused("up/secret.png");
  expectRefused("inside.png", "link.png");
}

TEST_F(Confined, RefusesAJsonThatLiesElsewhere) {
  const std::string path = scene("inside.png");
  fs::rename(path + "/transforms.json", folder.path() + "/elsewhere.json");
  fs::create_symlink(folder.path() + "/elsewhere.json", path + "/transforms.json");
  EXPECT_NO_THROW(loadDataset(path));
  expectError<std::invalid_argument>([&] { loadDataset(path, options); }, "transforms.json");
}

}  // namespace
}  // namespace nerf_pose_refiner
