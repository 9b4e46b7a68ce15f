// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "dataset/dataset.h"
#include "image/io.h"
#include "support/expect_error.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// A quarter turn about z, row by row.
const Json kTurn = {0, -1, 0, 1, 0, 0, 0, 0, 1};

class Bop : public testing::Test {
 protected:
  /// A scene of two images of 8 x 6 pixels; each shows the objects.
  void writeScene(const std::string& path, const std::vector<int>& objects) {
    camera = gt = info = Json::object();
    for (const int image : {3, 12}) {
      const std::string key = std::to_string(image);
      camera[key] = {{"cam_K", {20, 0, 4, 0, 21, 3, 0, 0, 1}}, {"depth_scale", 0.1}};
      for (std::size_t i = 0; i < objects.size(); ++i) {
        gt[key].push_back(
            {{"cam_R_m2c", kTurn}, {"cam_t_m2c", {100, 200, 850 + image}}, {"obj_id", objects[i]}});
        info[key].push_back({{"visib_fract", 1.0}});
        const std::string number = image == 3 ? "000003" : "000012";
        Image8 mask(8, 6, 1, 0);
        mask.at(static_cast<int>(i), 1, 0) = 255;
        writePng(mask, folder.file(path + "/mask_visib/" + number + "_00000" + std::to_string(i) +
                                   ".png"));
        writePng(Image8(8, 6, 3, 90), folder.file(path + "/rgb/" + number + ".png"));
      }
    }
    write(path);
  }

  void write(const std::string& path) const {
    folder.write(path + "/scene_camera.json", camera.dump());
    folder.write(path + "/scene_gt.json", gt.dump());
    folder.write(path + "/scene_gt_info.json", info.dump());
  }

  template <typename... Parts>
  void expectRefused(const Parts&... parts) const {
    write("scene");
    expectError<std::runtime_error>([this] { loadDataset(folder.file("scene")); },
                                    folder.file("scene"), parts...);
  }

  TemporaryFolder folder;
  Json camera, gt, info;
};

TEST_F(Bop, AScene) {
  writeScene("scene", {5});
  const Dataset dataset = loadDataset(folder.file("scene"));
  ASSERT_EQ(dataset.views.size(), 2u);
  const PosedView& view = dataset.views[0];  // 3 comes before 12, as numbers do
  EXPECT_TRUE(view.T_O_C.inverse().t.isApprox(Eigen::Vector3d(0.1, 0.2, 0.853)));
  EXPECT_TRUE(
      (view.T_O_C.inverse() * Eigen::Vector3d(1, 0, 0)).isApprox(Eigen::Vector3d(0.1, 1.2, 0.853)));
  EXPECT_EQ(view.camera.fx, 20);
  EXPECT_EQ(view.camera.fy, 21);
  EXPECT_EQ(view.camera.cx, 4) << "OpenCV's pixel centres";
  EXPECT_EQ(view.camera.cy, 3);
  EXPECT_EQ(view.rgba->at(0, 1, 3), 255);
  EXPECT_EQ(view.rgba->at(1, 1, 3), 0);
  EXPECT_EQ(dataset.metres_per_unit, 1);
  EXPECT_TRUE(dataset.has_masks);
}

TEST_F(Bop, TheObjectIsChosen) {
  writeScene("scene", {5, 7});
  DatasetOptions options;
  options.object_id = 7;
  const Dataset dataset = loadDataset(folder.file("scene"), options);
  EXPECT_EQ(dataset.views[0].rgba->at(0, 1, 3), 0);
  EXPECT_EQ(dataset.views[0].rgba->at(1, 1, 3), 255) << "the mask of the second in the list";
  expectRefused("several objects", "5, 7");
  options.object_id = 6;
  expectError<std::runtime_error>([&] { loadDataset(folder.file("scene"), options); },
                                  "not show the object 6", "5, 7");
}

// Onboarding: the object lies one way up, then the other; the poses are of one model.
TEST_F(Bop, SidesOfOneObject) {
  writeScene("onboarding_static/obj_000005_down", {5});
  writeScene("onboarding_static/obj_000005_up", {5});
  writeScene("onboarding_static/obj_000007_up", {7});
  DatasetOptions options;
  options.object_id = 5;
  const std::string path = folder.file("onboarding_static");
  EXPECT_EQ(loadDataset(path, options).views.size(), 4u);
  EXPECT_EQ(loadDataset(path + "/obj_000007_up").views.size(), 2u);
  expectError<std::runtime_error>([&] { loadDataset(path); }, "several objects", "5, 7");
}

// Of onboarding_dynamic not all frames have a pose.
TEST_F(Bop, ImagesWithoutPoseAreNotUsed) {
  writeScene("scene", {5});
  gt.erase("3");
  info.erase("3");
  write("scene");
  EXPECT_EQ(loadDataset(folder.file("scene")).views.size(), 1u);
}

TEST_F(Bop, HiddenObjectsAreLeftOut) {
  writeScene("scene", {5, 5});
  info["3"][0]["visib_fract"] = 0.3;  // the other one of the same kind is in full view
  info["12"][0]["visib_fract"] = info["12"][1]["visib_fract"] = 0.8;
  write("scene");
  const Dataset dataset = loadDataset(folder.file("scene"));
  ASSERT_EQ(dataset.views.size(), 1u);
  EXPECT_EQ(dataset.views[0].rgba->at(1, 1, 3), 255);
  ASSERT_EQ(dataset.notes.size(), 1u);
  EXPECT_NE(dataset.notes[0].find("1 images"), std::string::npos);
  info["3"][1]["visib_fract"] = 0.5;
  expectRefused("hidden in all images");
  fs::remove(folder.file("scene/scene_gt_info.json"));
  EXPECT_EQ(loadDataset(folder.file("scene")).views.size(), 2u);
}

TEST_F(Bop, GreyImagesAndWholeMasks) {
  writeScene("scene", {5});
  fs::rename(folder.file("scene/rgb"), folder.path() + "/scene/gray");
  fs::rename(folder.file("scene/mask_visib"), folder.path() + "/scene/mask");
  EXPECT_TRUE(loadDataset(folder.file("scene")).has_masks);
  fs::remove_all(folder.file("scene/gray"));
  expectRefused("no folder rgb or gray");
}

TEST_F(Bop, WhatMakesNoSense) {
  const auto refusedWith = [this](Json* file, const Json::json_pointer& place, const Json& value,
                                  const std::string& text) {
    writeScene("scene", {5});
    (*file)[place] = value;
    expectRefused(text);
  };
  using Place = Json::json_pointer;
  refusedWith(&camera, Place("/3/cam_K"), {1, 2, 3}, "cam_K is not a list of 9 numbers");
  refusedWith(&camera, Place("/3/cam_K/1"), 0.5, "without skew");
  refusedWith(&camera, Place("/3/cam_K/0"), "wide", "image 3: cam_K is not a finite number");
  refusedWith(&camera, Place("/3"), 7, "image 3: not an object");
  refusedWith(&gt, Place("/3/0/cam_R_m2c/0"), 2, "image 3, object 0: cam_R_m2c is not rigid");
  refusedWith(&gt, Place("/3/0/cam_t_m2c"), {1, 2}, "cam_t_m2c is not a list of 3 numbers");
  refusedWith(&gt, Place("/3/0/obj_id"), 1.5, "obj_id is not a whole number");
  refusedWith(&gt, Place("/3/0"), Json::array(), "not an object");
  refusedWith(&gt, Place("/seven"), Json::array(), "'seven' is not the number of an image");
  refusedWith(&gt, Place("/4"), Json::array(), "scene_camera.json has no such image");
  refusedWith(&gt, Place("/3"), "none", "no list of objects");
  refusedWith(&gt, Place(""), Json::object(), "no image has an object's pose");
  refusedWith(&gt, Place(""), {1, 2}, "no object at the top");
  writeScene("scene", {5});
  fs::remove(folder.file("scene/mask_visib/000012_000000.png"));
  expectRefused("image 12", "000012_000000.png", "No such file");
}

}  // namespace
}  // namespace nerf_pose_refiner
