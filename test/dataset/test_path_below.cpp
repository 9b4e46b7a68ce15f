// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/path_below.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>
#include <string>

#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

/// A folder with a folder "root" and a secret beside it.
class PathBelow : public testing::Test {
 protected:
  PathBelow() : folder_(temporary_.path()), root_((folder_ / "root").string()) {
    fs::create_directories(folder_ / "root" / "shelf");
    fs::create_directories(folder_ / "root_2");
    temporary_.write("secret", "secret");
  }

  TemporaryFolder temporary_;
  fs::path folder_;
  std::string root_;
};

TEST_F(PathBelow, FindsPathsBelowTheRoot) {
  const std::string root = fs::canonical(root_).string();
  EXPECT_EQ(pathBelow(root_, "shelf"), root + "/shelf");
  EXPECT_EQ(pathBelow(root_ + "/", "shelf/mug"), root + "/shelf/mug");
  EXPECT_EQ(pathBelow(root_ + "/./shelf", "mug"), root + "/shelf/mug");
  fs::create_directory_symlink(folder_ / "root" / "shelf", folder_ / "root" / "link");
  EXPECT_EQ(pathBelow(root_, "link/mug"), root + "/shelf/mug");
}

TEST_F(PathBelow, RefusesPathsOutOfTheRoot) {
  EXPECT_THROW(pathBelow(root_, "../secret"), std::invalid_argument);
  EXPECT_THROW(pathBelow(root_, "shelf/../../secret"), std::invalid_argument);
  EXPECT_THROW(pathBelow(root_, (folder_ / "secret").string()), std::invalid_argument);
  EXPECT_THROW(pathBelow(root_, root_ + "/shelf"), std::invalid_argument);
  EXPECT_THROW(pathBelow(root_, ""), std::invalid_argument);
  EXPECT_THROW(pathBelow("", "shelf"), std::invalid_argument);
}

TEST_F(PathBelow, RefusesLinksOutOfTheRoot) {
  fs::create_symlink(folder_ / "secret", folder_ / "root" / "file");
  fs::create_directory_symlink(folder_, folder_ / "root" / "up");
  fs::create_directory_symlink(folder_ / "root_2", folder_ / "root" / "twin");
  EXPECT_THROW(pathBelow(root_, "file"), std::invalid_argument);
  EXPECT_THROW(pathBelow(root_, "up/secret"), std::invalid_argument);
  fs::create_symlink(folder_ / "nowhere", folder_ / "root" / "dangling");
  EXPECT_THROW(pathBelow(root_, "dangling"), std::invalid_argument);
  EXPECT_THROW(pathBelow(root_, "dangling/mug"), std::invalid_argument);
  EXPECT_THROW(pathBelow(root_, "twin"), std::invalid_argument) << "its name begins as the root's";
}

}  // namespace
}  // namespace nerf_pose_refiner
