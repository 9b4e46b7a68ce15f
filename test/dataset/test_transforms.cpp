// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "dataset/dataset.h"
#include "image/io.h"
#include "support/expect_error.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

using Json = nlohmann::json;

/// A small scene of two frames that each test changes to its needs.
class Transforms : public testing::Test {
 protected:
  Transforms() {
    writePng(Image8(8, 6, 4, 200), folder.file("images/a.png"));
    writePng(Image8(8, 6, 4, 100), folder.file("images/b.png"));
    scene = Json::parse(R"({
      "camera_angle_x": 1.0,
      "frames": [
        {"file_path": "images/a.png",
         "transform_matrix": [[1, 0, 0, 1], [0, 1, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]},
        {"file_path": "./images/b.png",
         "transform_matrix": [[0, 0, 1, 4], [1, 0, 0, 5], [0, 1, 0, 6], [0, 0, 0, 1]]}]})");
  }

  Dataset load() const { return loadDataset(folder.write("transforms.json", scene.dump())); }

  template <typename... Parts>
  void expectRefused(const Parts&... parts) const {
    expectError<std::runtime_error>([this] { load(); }, folder.file("transforms.json"), parts...);
  }

  TemporaryFolder folder;
  Json scene;
};

void expectCamera(const Camera& camera, double fx, double fy, double cx, double cy) {
  EXPECT_EQ(camera.width, 8);
  EXPECT_EQ(camera.height, 6);
  EXPECT_NEAR(camera.fx, fx, 1e-12);
  EXPECT_NEAR(camera.fy, fy, 1e-12);
  EXPECT_NEAR(camera.cx, cx, 1e-12);
  EXPECT_NEAR(camera.cy, cy, 1e-12);
}

// ---- what is read ----

TEST_F(Transforms, NerfSyntheticStyle) {
  scene["frames"][0]["file_path"] = "./images/a";
  scene["frames"][0]["rotation"] = 0.01;
  const Dataset dataset = load();
  ASSERT_EQ(dataset.views.size(), 2u);
  EXPECT_EQ(dataset.views[0].name, folder.file("images/a.png"));
  EXPECT_EQ(dataset.folder, folder.path());
  EXPECT_EQ(dataset.views[0].rgba->channels, 4);
  EXPECT_EQ(dataset.views[0].rgba->at(3, 2, 3), 200);
  EXPECT_EQ(dataset.views[1].rgba->at(3, 2, 0), 100);
  EXPECT_TRUE(dataset.has_alpha);
  EXPECT_FALSE(dataset.has_box);
  EXPECT_EQ(dataset.metres_per_unit, 0);
  // f = 4 / tan(0.5); the middle of 8 x 6 pixels lies at (3.5, 2.5)
  expectCamera(dataset.views[0].camera, 7.321950886849808, 7.321950886849808, 3.5, 2.5);
}

TEST_F(Transforms, OpenGlAxesBecomeOptical) {
  const Dataset dataset = load();
  // Frame 0 looks along -z of O with y up: optical z is -z, optical y is -y.
  Eigen::Matrix3d R;
  R << 1, 0, 0, 0, -1, 0, 0, 0, -1;
  EXPECT_TRUE(dataset.views[0].T_O_C.R.isApprox(R, 1e-15));
  EXPECT_TRUE(dataset.views[0].T_O_C.t.isApprox(Eigen::Vector3d(1, 2, 3)));
  // Frame 1: camera x is O's y, camera y (up) is O's z, camera z (back) is O's x.
  R << 0, 0, -1, 1, 0, 0, 0, -1, 0;
  EXPECT_TRUE(dataset.views[1].T_O_C.R.isApprox(R, 1e-15));
  // A point before the camera, to its right and above, is seen to the right and up.
  const Eigen::Vector3d p_O(4 - 10, 5 + 1, 6 + 0.5);
  const Eigen::Vector2d pixel =
      dataset.views[1].camera.project(dataset.views[1].T_O_C.inverse() * p_O);
  EXPECT_NEAR(pixel.x(), 3.5 + 0.7321950886849808, 1e-9);
  EXPECT_NEAR(pixel.y(), 2.5 - 0.3660975443424904, 1e-9);
}

TEST_F(Transforms, InstantNgpStyle) {
  scene["fl_x"] = 20.0;
  scene["fl_y"] = 21.0;
  scene["cx"] = 4.25;
  scene["cy"] = 2.75;
  scene["w"] = 8.0;  // instant-ngp writes them with a point
  scene["h"] = 6.0;
  scene["aabb_scale"] = 16;
  scene["k1"] = 0;
  expectCamera(load().views[0].camera, 20, 21, 3.75, 2.25);
}

TEST_F(Transforms, FramesOverrideIntrinsics) {
  scene["fl_x"] = 20;
  scene["cx"] = 4;
  scene["frames"][1]["fl_x"] = 30;
  scene["frames"][1]["fl_y"] = 31;
  scene["frames"][1]["cx"] = 5;
  const Dataset dataset = load();
  expectCamera(dataset.views[0].camera, 20, 20, 3.5, 2.5);
  expectCamera(dataset.views[1].camera, 30, 31, 4.5, 2.5);
}

TEST_F(Transforms, BothFieldsOfView) {
  scene["camera_angle_y"] = 0.8;
  expectCamera(load().views[0].camera, 7.321950886849808, 3 / std::tan(0.4), 3.5, 2.5);
}

TEST_F(Transforms, SizeOfTheFileDoesNotMatterToAFieldOfView) {
  scene["w"] = 800;
  scene["h"] = 600;
  EXPECT_EQ(load().views[0].camera.width, 8);
}

TEST_F(Transforms, MasksBecomeAlpha) {
  Image8 mask(8, 6, 1, 0);
  mask.at(2, 1, 0) = 255;
  mask.at(3, 1, 0) = 128;
  for (const char* name : {"a", "b"}) {
    writePng(Image8(8, 6, 3, 50), folder.file(std::string("images/") + name + ".png"));
    writePng(mask, folder.file(std::string("masks/") + name + ".png"));
  }
  scene["frames"][0]["mask_path"] = "masks/a.png";
  scene["frames"][1]["mask_path"] = "./masks/b.png";
  const Dataset dataset = load();
  EXPECT_TRUE(dataset.has_alpha);
  const Image8& rgba = *dataset.views[0].rgba;
  EXPECT_EQ(rgba.at(2, 1, 0), 50);
  EXPECT_EQ(rgba.at(2, 1, 3), 255);
  EXPECT_EQ(rgba.at(3, 1, 3), 128);
  EXPECT_EQ(rgba.at(4, 1, 3), 0);
}

// Values that say that nothing is known, but in a mask with soft edges, which has any value.
TEST_F(Transforms, MaskThatIsUnsure) {
  for (const char* name : {"images/a.png", "images/b.png"}) {
    writePng(Image8(8, 6, 3, 50), folder.file(name));
  }
  for (const int soft : {0, 100}) {
    Image8 mask(8, 6, 1, 0);
    mask.at(0, 0, 0) = static_cast<std::uint8_t>(soft);
    mask.at(1, 0, 0) = 1, mask.at(2, 0, 0) = 254, mask.at(3, 0, 0) = 255;
    writePng(mask, folder.file("mask.png"));
    for (auto& frame : scene["frames"]) frame["mask_path"] = "mask.png";
    const Dataset dataset = load();
    const Image8& rgba = *dataset.views[0].rgba;
    EXPECT_EQ(rgba.at(0, 0, 3), soft);
    EXPECT_EQ(rgba.at(1, 0, 3), soft ? 0 : 1);
    EXPECT_EQ(rgba.at(2, 0, 3), soft ? 255 : 254);
    EXPECT_EQ(rgba.at(3, 0, 3), 255);
  }
}

TEST_F(Transforms, MaskNarrowsAnAlphaThatIsThere) {
  writePng(Image8(8, 6, 1, 128), folder.file("mask.png"));
  scene["frames"][0]["mask_path"] = "mask.png";
  EXPECT_EQ(load().views[0].rgba->at(0, 0, 3), 100);  // 200 * 128 / 255
}

TEST_F(Transforms, PhotosWithoutAlphaAreOpaque) {
  for (const char* name : {"images/a.png", "images/b.png"}) {
    writePng(Image8(8, 6, 3, 50), folder.file(name));
  }
  const Dataset dataset = load();
  EXPECT_FALSE(dataset.has_alpha);
  EXPECT_EQ(dataset.views[0].rgba->at(0, 0, 3), 255);
}

TEST_F(Transforms, BoxAndScale) {
  scene["aabb"] = {{-1, -2, -3}, {1, 2, 3}};
  scene["metres_per_unit"] = 0.25;
  const Dataset dataset = load();
  EXPECT_TRUE(dataset.has_box);
  EXPECT_EQ(dataset.box_min, Eigen::Vector3d(-1, -2, -3));
  EXPECT_EQ(dataset.box_max, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(dataset.metres_per_unit, 0.25);
  scene["object_aabb"] = {{0, 0, 0}, {1, 1, 1}};  // the object's own comes first
  EXPECT_EQ(load().box_min, Eigen::Vector3d(0, 0, 0));
}

TEST_F(Transforms, FolderMeansTransformsOrTransformsTrain) {
  folder.write("transforms_train.json", scene.dump());
  EXPECT_EQ(loadDataset(folder.path()).views.size(), 2u);
  scene["frames"].erase(1);
  load();
  EXPECT_EQ(loadDataset(folder.path()).views.size(), 1u);
}

TEST_F(Transforms, DistortedImagesAreUndistorted) {
  scene["fl_x"] = 8;
  scene["k1"] = -0.2;
  scene["k2"] = 0.02;
  const Dataset dataset = load();
  const Camera& camera = dataset.views[0].camera;
  EXPECT_EQ(camera.width, 8);
  EXPECT_LT(camera.fx, 7.9);  // barrel distortion: the straight image sees more per pixel
  EXPECT_GT(camera.fx, 6);
  EXPECT_EQ(dataset.views[0].rgba->width, 8);
}

TEST_F(Transforms, NearlyRigidIsMadeRigid) {
  scene["frames"][0]["transform_matrix"][0][0] = 1.0002;
  EXPECT_TRUE(load().views[0].T_O_C.isRigid(1e-12));
}

TEST_F(Transforms, MatrixOfThreeRowsWillDo) {
  scene["frames"][0]["transform_matrix"].erase(3);
  EXPECT_TRUE(load().views[0].T_O_C.t.isApprox(Eigen::Vector3d(1, 2, 3)));
}

// ---- what is refused ----

TEST_F(Transforms, MissingFiles) {
  expectError<std::runtime_error>([this] { loadDataset(folder.file("none.json")); },
                                  folder.file("none.json"), "No such file");
  const TemporaryFolder empty;
  expectError<std::runtime_error>([&] { loadDataset(empty.path()); }, empty.path(),
                                  "transforms_train.json");
  scene["frames"][1]["file_path"] = "images/none";
  expectRefused("frame 1 ('images/none')", folder.path() + "/images/none'", ".png");
}

TEST_F(Transforms, TheFirstBadFrameIsNamed) {
  scene["frames"][0]["file_path"] = "images/none0";
  scene["frames"][1]["file_path"] = "images/none1";
  expectRefused("frame 0 ('images/none0')");
}

TEST_F(Transforms, BadImages) {
  folder.write("images/b.png", "no picture");
  expectRefused("frame 1", folder.file("images/b.png"), "damaged");
}

TEST_F(Transforms, NoImageIsReadAfterAStop) {
  for (const char* name : {"a", "b"}) {
    folder.write(std::string("images/") + name + ".png", "no picture");  // reading it would show
  }
  const CancellationToken cancellation;
  cancellation.requestCancel();
  const std::string path = folder.write("transforms.json", scene.dump());
  EXPECT_THROW(loadDataset(path, DatasetOptions(), cancellation), Cancelled);
}

TEST_F(Transforms, WrongSizes) {
  scene["fl_x"] = 20;
  scene["w"] = 16;
  scene["h"] = 12;
  expectRefused("frame 0", "16 x 12", "8 x 6");
  scene["w"] = -8;
  expectRefused("w is not positive");
}

TEST_F(Transforms, BadMasks) {
  scene["frames"][1]["mask_path"] = "mask.png";
  expectRefused("frame 1", folder.file("mask.png"), "No such file");
  writePng(Image8(4, 6, 1, 255), folder.file("mask.png"));
  expectRefused("frame 1", "mask.png", "4 x 6", "8 x 6");
  scene["frames"][1]["mask_path"] = 7;
  expectRefused("frame 1", "mask_path");
}

TEST_F(Transforms, SomeFramesWithoutAlpha) {
  writePng(Image8(8, 6, 3, 50), folder.file("images/b.png"));
  expectRefused("frame 1", "neither alpha channel nor mask");
  writePng(Image8(8, 6, 3, 50), folder.file("images/a.png"));
  writePng(Image8(8, 6, 4, 50), folder.file("images/b.png"));
  expectRefused("frame 0", "neither alpha channel nor mask");
}

TEST_F(Transforms, MatricesThatAreNoPose) {
  Json& matrix = scene["frames"][1]["transform_matrix"];
  const Json good = matrix;
  matrix[0] = {0, 0, 1.01, 4};
  expectRefused("frame 1 ('./images/b.png')", "not rigid");
  matrix = good;
  matrix[0] = {0, 0, -1, 4};  // a mirror
  expectRefused("frame 1", "not rigid");
  matrix = good;
  matrix[3] = {0, 0, 0, 2};
  expectRefused("frame 1", "not rigid");
  matrix = good;
  matrix[2][3] = nullptr;
  expectRefused("frame 1", "transform_matrix[2][3]", "not a finite number");
  matrix = good;
  matrix[1] = {1, 0, 0};
  expectRefused("frame 1", "row 1");
  matrix = "identity";
  expectRefused("frame 1", "transform_matrix");
  scene["frames"][1].erase("transform_matrix");
  expectRefused("frame 1", "transform_matrix is missing");
}

TEST_F(Transforms, NanAsPythonWritesItNamesTheFrame) {
  for (const std::string bad : {"NaN", "Infinity", "-Infinity"}) {
    scene["frames"][1]["transform_matrix"][0][3] = "HERE";
    scene["note"] = "a quote \\\" and a NaN, which is text";
    std::string text = scene.dump();
    text.replace(text.find("\"HERE\""), 6, bad);
    const std::string path = folder.write("transforms.json", text);
    expectError<std::runtime_error>([&] { loadDataset(path); }, path, "frame 1",
                                    "transform_matrix[0][3]");
  }
}

TEST_F(Transforms, BadIntrinsics) {
  scene["camera_angle_x"] = 3.2;
  expectRefused("frame 0", "camera_angle_x");
  scene["camera_angle_x"] = "wide";
  expectRefused("frame 0", "camera_angle_x is not a finite number");
  scene.erase("camera_angle_x");
  expectRefused("frame 0", "neither fl_x nor camera_angle_x");
  scene["fl_x"] = 20;
  scene["frames"][1]["fl_x"] = 0;
  expectRefused("frame 1", "fl_x is not positive");
  scene["frames"][1].erase("fl_x");
  scene["k1"] = -1000;
  expectRefused("frame 0", "folds");
}

TEST_F(Transforms, OtherLensesAreNotTakenForPinholes) {
  scene["camera_model"] = "OPENCV";
  EXPECT_NO_THROW(load());
  scene["camera_model"] = "EQUIRECTANGULAR";
  expectRefused("frame 0", "EQUIRECTANGULAR");
  scene["camera_model"] = "OPENCV_FISHEYE";
  expectRefused("frame 0", "fl_x");
  scene.erase("camera_model");
  scene["is_fisheye"] = true;
  expectRefused("frame 0", "fl_x");
}

TEST_F(Transforms, BrokenJson) {
  const auto expectBroken = [this](const std::string& text, const std::string& reason) {
    const std::string path = folder.write("transforms.json", text);
    expectError<std::runtime_error>([&] { loadDataset(path); }, path, reason);
  };
  expectBroken("", "parse error");
  expectBroken("{\"frames\": [", "parse error");
  expectBroken("\x89PNG", "parse error");
  expectBroken("[1, 2]", "no object");
  expectBroken("{}", "'frames'");
  expectBroken("{\"frames\": {}}", "'frames' is not a list");
  expectBroken("{\"frames\": []}", "'frames' is empty");
  expectBroken("{\"frames\": [3]}", "frame 0");
  expectBroken("{\"frames\": [{}]}", "file_path is missing");
  expectBroken("{\"frames\": [{\"file_path\": 3}]}", "file_path");
}

TEST_F(Transforms, BadBoxes) {
  scene["aabb"] = {{0, 0, 0}, {1, 0, 1}};
  expectRefused("aabb", "empty");
  scene["aabb"] = {{0, 0, 0}};
  expectRefused("aabb", "[[min], [max]]");
  scene["aabb"] = {{0, 0}, {1, 1}};
  expectRefused("aabb", "3 numbers");
  scene["aabb"] = {{0, 0, 0}, {1, 1, "1"}};
  expectRefused("aabb", "finite");
  scene.erase("aabb");
  scene["metres_per_unit"] = 0;
  expectRefused("metres_per_unit");
}

}  // namespace
}  // namespace nerf_pose_refiner
