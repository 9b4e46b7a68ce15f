// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "dataset/dataset.h"
#include "image/io.h"
#include "support/expect_error.h"
#include "support/temporary_folder.h"

// Scans of Polycam and Record3D: a world with y up, cameras with OpenGL's axes, metres.

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::json;

/// Of a camera at (1, 2, 3) with y up that is not turned: z up it is at (3, 1, 2), its right is y,
/// its down -z, and it looks along -x.
void expectUprightCamera(const PosedView& view) {
  EXPECT_TRUE(view.T_O_C.t.isApprox(Eigen::Vector3d(3, 1, 2))) << view.T_O_C.t.transpose();
  EXPECT_TRUE(view.T_O_C.R.col(0).isApprox(Eigen::Vector3d(0, 1, 0), 1e-12)) << view.T_O_C.R;
  EXPECT_TRUE(view.T_O_C.R.col(1).isApprox(Eigen::Vector3d(0, 0, -1), 1e-12)) << view.T_O_C.R;
  EXPECT_TRUE(view.T_O_C.R.col(2).isApprox(Eigen::Vector3d(-1, 0, 0), 1e-12)) << view.T_O_C.R;
}

class Polycam : public testing::Test {
 protected:
  Polycam() {
    for (const char* key : {"t_01", "t_02", "t_10", "t_12", "t_20", "t_21"}) camera[key] = 0;
    for (const char* key : {"t_00", "t_11", "t_22", "t_03"}) camera[key] = 1;
    camera["t_13"] = 2;
    camera["t_23"] = 3;
    camera["blur_score"] = 140.5;
    camera["width"] = 8;
    camera["height"] = 6;
    camera["fx"] = 10;
    camera["fy"] = 11;
    camera["cx"] = 4.5;
    camera["cy"] = 3.5;
  }

  void writeKeyframes(const std::string& prefix) const {
    for (const char* name : {"1651", "1652"}) {
      writePng(Image8(8, 6, 3, 90), folder.file("keyframes/" + prefix + "images/" + name + ".png"));
      folder.write("keyframes/" + prefix + "cameras/" + name + ".json", camera.dump());
    }
  }

  TemporaryFolder folder;
  Json camera;
};

TEST_F(Polycam, Keyframes) {
  writeKeyframes("");
  const Dataset dataset = loadDataset(folder.path());
  ASSERT_EQ(dataset.views.size(), 2u);
  expectUprightCamera(dataset.views[0]);
  EXPECT_EQ(dataset.views[0].camera.fy, 11);
  EXPECT_EQ(dataset.views[0].camera.cx, 4);
  EXPECT_EQ(dataset.metres_per_unit, 1);
}

TEST_F(Polycam, CorrectedOnesComeFirst) {
  writeKeyframes("");
  camera["fx"] = 12;
  writeKeyframes("corrected_");
  EXPECT_EQ(loadDataset(folder.path()).views[0].camera.fx, 12);
}

TEST_F(Polycam, WhatMakesNoSense) {
  const Json good = camera;
  for (const char* key : {"t_12", "fx", "height"}) {
    camera = good;
    camera.erase(key);
    writeKeyframes("");
    expectError<std::runtime_error>([this] { loadDataset(folder.path()); }, "1651.json", key,
                                    "missing");
  }
  camera = good;
  camera["t_00"] = 2;
  writeKeyframes("");
  expectError<std::runtime_error>([this] { loadDataset(folder.path()); }, "1651.json", "not rigid");
  camera = good;
  writeKeyframes("");
  fs::remove(folder.file("keyframes/images/1652.png"));
  expectError<std::runtime_error>([this] { loadDataset(folder.path()); }, "1652.json", "no file");
  DatasetOptions options;
  options.limits.frames = 1;
  expectError<std::runtime_error>([&] { loadDataset(folder.path(), options); },
                                  "more than 1 photos");
}

class Record3d : public testing::Test {
 protected:
  Record3d() {
    metadata = {
        {"w", 8},
        {"h", 6},
        {"fps", 60},
        {"K", {10, 0, 0, 0, 11, 0, 4.5, 3.5, 1}},
        {"poses", {{0, 0, 0, 1, 1, 2, 3}, {0, std::sqrt(0.5), 0, std::sqrt(0.5), 0, 0, 0}}}};
    for (const char* name : {"rgb/0.png", "rgb/1.png"}) {
      writePng(Image8(8, 6, 3, 90), folder.file(name));
    }
  }

  Dataset load() const {
    folder.write("metadata", metadata.dump());
    return loadDataset(folder.path());
  }

  TemporaryFolder folder;
  Json metadata;
};

TEST_F(Record3d, PosesAndIntrinsics) {
  const Dataset dataset = load();
  ASSERT_EQ(dataset.views.size(), 2u);
  expectUprightCamera(dataset.views[0]);
  EXPECT_EQ(dataset.views[0].camera.fx, 10);
  EXPECT_EQ(dataset.views[0].camera.fy, 11);
  EXPECT_EQ(dataset.views[0].camera.cx, 4);
  EXPECT_EQ(dataset.views[0].camera.cy, 3);
  EXPECT_EQ(dataset.metres_per_unit, 1);
  // A quarter turn about y, which is up: looks along -x of the old world, -y of the new one.
  EXPECT_TRUE(dataset.views[1].T_O_C.R.col(2).isApprox(Eigen::Vector3d(0, -1, 0), 1e-12));
}

TEST_F(Record3d, WhatMakesNoSense) {
  const Json good = metadata;
  const auto refusedWith = [&](const char* key, const Json& value, const std::string& text) {
    metadata = good;
    metadata[key] = value;
    expectError<std::runtime_error>([this] { load(); }, folder.file("metadata"), text);
  };
  refusedWith("K", {1, 2}, "K is not a list of 9 numbers");
  refusedWith("K", {-10, 0, 0, 0, 11, 0, 4.5, 3.5, 1}, "focal lengths");
  refusedWith("w", 0, "w is not positive");
  refusedWith("poses", Json::array(), "poses");
  refusedWith("poses", Json::array({Json{0, 0, 0, 0, 1, 2, 3}}), "quaternion");
  refusedWith("poses", Json::array({Json{0, 0, 0, 1, 1, 2}}), "7 numbers");
  refusedWith("w", 6, "6 x 6");  // the photos have 8
  metadata = good;
  fs::remove(folder.file("rgb/1.png"));
  expectError<std::runtime_error>([this] { load(); }, "photo 1", "rgb/1'");
}

}  // namespace
}  // namespace nerf_pose_refiner
