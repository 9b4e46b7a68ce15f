// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>

#include "dataset/dataset.h"
#include "image/io.h"
#include "support/expect_error.h"
#include "support/temporary_folder.h"

// What a dataset may not ask of the machine.

namespace nerf_pose_refiner {
namespace {

using Json = nlohmann::json;

/// Two frames of 8 x 6 pixels.
class DatasetLimitsTest : public testing::Test {
 protected:
  DatasetLimitsTest() {
    const Json pose = {{1, 0, 0, 1}, {0, 1, 0, 2}, {0, 0, 1, 3}, {0, 0, 0, 1}};
    scene["camera_angle_x"] = 1.0;
    for (const char* name : {"images/a.png", "images/b.png"}) {
      writePng(Image8(8, 6, 4, 200), folder.file(name));
      scene["frames"].push_back({{"file_path", name}, {"transform_matrix", pose}});
    }
  }

  Dataset load() const { return loadDataset(folder.write("transforms.json", scene.dump())); }

  template <typename... Parts>
  void expectRefused(const Parts&... parts) const {
    expectError<std::runtime_error>([this] { load(); }, folder.file("transforms.json"), parts...);
  }

  /// Refused by `options`, and read without them.
  template <typename... Parts>
  void expectTooMuch(const Parts&... parts) const {
    const std::string path = folder.write("transforms.json", scene.dump());
    EXPECT_NO_THROW(loadDataset(path));
    expectError<std::runtime_error>([&] { loadDataset(path, options); }, path, parts...);
  }

  TemporaryFolder folder;
  Json scene;
  DatasetOptions options;
};

TEST_F(DatasetLimitsTest, OfFrames) {
  options.limits.frames = 1;
  expectTooMuch("2 frames", "at most 1");
}

TEST_F(DatasetLimitsTest, OfAnImage) {
  options.limits.image_pixels = 8 * 6 - 1;
  expectTooMuch("frame 0", "images/a.png", "8 x 6", "at most 47");
}

TEST_F(DatasetLimitsTest, OfAMask) {
  writePng(Image8(8, 6, 1, 255), folder.file("mask.png"));
  scene["frames"][0]["mask_path"] = "mask.png";
  EXPECT_NO_THROW(load());
  writePng(Image8(80, 60, 1, 255), folder.file("mask.png"));
  options.limits.image_pixels = 8 * 6;
  const std::string path = folder.file("transforms.json");
  expectError<std::runtime_error>([&] { loadDataset(path, options); }, "frame 0", "mask.png",
                                  "80 x 60", "at most 48");
}

TEST_F(DatasetLimitsTest, OfAllImages) {
  options.limits.pixels = 2 * 8 * 6 - 1;
  expectTooMuch("frame 1", "images/b.png", "95 pixels together");
}

TEST_F(DatasetLimitsTest, OfTheJson) {
  options.limits.json_bytes = 100;
  expectTooMuch("at most 100");
}

TEST_F(DatasetLimitsTest, OneImageInTwoFramesIsRefused) {
  scene["frames"][1]["file_path"] = "images/../images/a";
  expectRefused("frame 1", "frame 0 has the same image", "images/a.png");
  std::filesystem::create_symlink("a.png", folder.file("images/link.png"));
  scene["frames"][1]["file_path"] = "images/link.png";
  expectRefused("frame 1", "frame 0 has the same image", "images/link.png");
}

TEST_F(DatasetLimitsTest, DeepJsonIsRefused) {
  const auto nested = [](int n) { return std::string(n, '[') + std::string(n, ']'); };
  const std::string text = scene.dump();
  for (const char* key : {"camera_model", "is_fisheye", "aabb", "unknown"}) {
    const std::string path =
        folder.write("transforms.json",
                     std::string("{\"") + key + "\":" + nested(500000) + "," + text.substr(1));
    expectError<std::runtime_error>([&] { loadDataset(path); }, path, "nest deeper");
  }
  scene["camera_model"] = {{"a", "b"}};
  expectRefused("camera model", "object");
}

TEST_F(DatasetLimitsTest, APipeIsNotWaitedFor) {
  const std::string pipe = folder.file("pipe.json");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  expectError<std::runtime_error>([&] { loadDataset(pipe); }, pipe, "no regular file");
  scene["frames"][1]["mask_path"] = "pipe.json";
  expectRefused("frame 1", pipe, "no regular file");
}

}  // namespace
}  // namespace nerf_pose_refiner
