// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "field/object_metadata.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>

#include "field/model_file.h"
#include "math/angle.h"
#include "support/expect_error.h"
#include "support/small_field.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

class ObjectMetadataTest : public testing::Test {
 protected:
  ObjectMetadata read(const std::string& text) {
    std::ofstream(path) << text;
    return readObjectMetadata(path);
  }

  template <typename... Parts>
  void expectRefused(const std::string& text, const Parts&... parts) {
    SCOPED_TRACE(text);
    expectError<std::runtime_error>([&] { read(text); }, "mug.yaml", parts...);
  }

  TemporaryFolder folder;
  std::string path = folder.file("mug.yaml");
};

TEST_F(ObjectMetadataTest, ReadsAll) {
  const ObjectMetadata m = read(R"(
# of a mug
metres_per_unit: 0.1
frame_in_model:
  position: [1, 2, 3.5]
  orientation: [0, 0, 0.70711, 0.70711]
bounding_box: {min: [-1, -2, -3], max: [1, 2, 3e0]}
symmetries:
  continuous: {axis: [0, 0, 1], point: [0.5, 0, 0]}
  discrete:
    - {axis: [1, 0, 0], fold: 2}
    - {orientation: [0, 1, 0, 0], position: [1, 0, 0]}
)");
  EXPECT_EQ(m.metres_per_unit, 0.1);
  EXPECT_EQ(m.T_O_U.t, Eigen::Vector3d(1, 2, 3.5));
  EXPECT_LT(rotationDistance(m.T_O_U.R, expSO3({0, 0, kPi / 2})), 1e-5);
  ASSERT_TRUE(m.box);
  EXPECT_EQ(m.box->min, Eigen::Vector3d(-1, -2, -3));
  EXPECT_EQ(m.box->max, Eigen::Vector3d(1, 2, 3));
  ASSERT_TRUE(m.symmetries.axis());
  EXPECT_EQ(m.symmetries.axis()->point, Eigen::Vector3d(0.5, 0, 0));
  EXPECT_EQ(m.symmetries.motions().size(), 2u) << "two flips that differ by a turn about the axis";
}

TEST_F(ObjectMetadataTest, ReadsTheExampleOfTheReadme) {
  const std::string readme = readFile(std::string(NPR_SOURCE_DIR) + "/README.md");
  const std::size_t begin = readme.find("    metres_per_unit: 0.1");
  ASSERT_NE(begin, std::string::npos);
  const ObjectMetadata m = read(readme.substr(begin, readme.find("\n\n", begin) - begin));
  EXPECT_EQ(m.metres_per_unit, 0.1);
  EXPECT_EQ(m.T_O_U.t.z(), -0.4);
  EXPECT_EQ(m.box->max.z(), 1.6);
  EXPECT_TRUE(m.symmetries.axis());
  EXPECT_EQ(m.symmetries.motions().size(), 2u);
}

TEST_F(ObjectMetadataTest, ReadsWhatItWrites) {
  ObjectMetadata written;
  written.metres_per_unit = 1.0 / 3;
  written.T_O_U = {expSO3({0.1, -2, 0.3}), {1, 1.0 / 7, -1e-6}};
  written.box = Box{{-1, -2, -3}, {1, 2, 1.0 / 3}};
  written.symmetries = Symmetries(SymmetryAxis{{0.6, 0, 0.8}, {0.5, 0, 0}},
                                  {turnAbout({{0, 1, 0}, {0.5, 0, 0}}, kPi)});
  writeObjectMetadata(written, path);
  const ObjectMetadata read = readObjectMetadata(path);
  EXPECT_EQ(read.metres_per_unit, written.metres_per_unit);
  EXPECT_TRUE(sameFrame(read, written));
  EXPECT_EQ(read.symmetries.motions().size(), 2u);
  ObjectMetadata other = read;
  other.T_O_U.t.x() += 1e-6;
  EXPECT_FALSE(sameFrame(other, written));
  other = read;
  other.box.reset();
  EXPECT_FALSE(sameFrame(other, written));
  other = read;
  other.symmetries = Symmetries(written.symmetries.axis(), {});
  EXPECT_FALSE(sameFrame(other, written));
}

TEST_F(ObjectMetadataTest, AllMayBeLeftOut) {
  for (const char* text : {"", "# nothing\n", "---\n", "symmetries: {}\n"}) {
    const ObjectMetadata m = read(text);
    EXPECT_EQ(m.metres_per_unit, 0) << text;
    EXPECT_TRUE(m.T_O_U.R.isIdentity()) << text;
    EXPECT_FALSE(m.box || m.symmetries.any()) << text;
  }
  EXPECT_FALSE(readObjectMetadata(folder.file("no_such.yaml")).box);
  EXPECT_TRUE(read("frame_in_model: {position: [1, 0, 0]}").T_O_U.R.isIdentity());
}

TEST_F(ObjectMetadataTest, SaysWhereAndWhatIsWrong) {
  expectRefused("metres_per_unit: 1\nframe_in_modle: {}\n", "line 2", "'frame_in_modle'",
                "frame_in_model");
  expectRefused("frame_in_model:\n  position: [0, 0, 0]\n  rotation: [0, 0, 0, 1]\n", "line 3",
                "'rotation'", "orientation");
  expectRefused("metres_per_unit: 1\nmetres_per_unit: 2\n", "line 2", "twice");
  expectRefused("metres_per_unit: one\n", "line 1", "metres_per_unit", "a number");
  expectRefused("metres_per_unit: \"1\"\n", "metres_per_unit", "a number");
  expectRefused("metres_per_unit: .nan\n", "metres_per_unit", "finite");
  expectRefused("metres_per_unit: -.inf\n", "metres_per_unit", "finite");
  expectRefused("metres_per_unit: 0\n", "metres_per_unit", "greater than 0");
  expectRefused("\n\nframe_in_model: 3\n", "line 3", "frame_in_model", "map", "position");
  expectRefused("frame_in_model: {position: [1, 2]}", "position", "3 numbers");
  expectRefused("frame_in_model: {position: [1, 2, x]}", "position", "a number");
  expectRefused("frame_in_model: {position: [1, 2, [3]]}", "position", "a number");
  expectRefused("frame_in_model: {position: [1, 2, .nan]}", "position", "finite");
  expectRefused("frame_in_model: {orientation: [0, 0, 1, 1]}", "orientation", "length 1", "1.414");
  expectRefused("frame_in_model: {orientation: [0, 0, 0, 0]}", "orientation", "length 1");
  expectRefused("bounding_box: {min: [0, 0, 0]}", "bounding_box", "'max'");
  expectRefused("bounding_box:\n  min: [0, 0, 0]\n  max: [1, -1, 1]\n", "bounding_box", "greater");
  expectRefused("[1, 2]", "the file", "map");
  expectRefused("just text", "the file", "map");
}

TEST_F(ObjectMetadataTest, SymmetriesAreCheckedToo) {
  expectRefused("symmetries: {continous: {axis: [0, 0, 1]}}", "'continous'", "continuous");
  expectRefused("symmetries: {continuous: {point: [0, 0, 1]}}", "continuous", "'axis'");
  expectRefused("symmetries: {continuous: {axis: [0, 0, 2]}}", "axis", "length 1");
  expectRefused("symmetries: {continuous: {axis: [0, 0, 1], fold: 2}}", "'fold'");
  expectRefused("symmetries: {discrete: {axis: [0, 0, 1], fold: 2}}", "discrete", "list");
  expectRefused("symmetries: {discrete: [{axis: [0, 0, 1]}]}", "'fold'");
  expectRefused("symmetries: {discrete: [{axis: [0, 0, 1], fold: 2.5}]}", "fold", "whole number");
  expectRefused("symmetries: {discrete: [{axis: [0, 0, 1], fold: 1}]}", "fold", "from 2");
  expectRefused("symmetries: {discrete: [7]}", "discrete", "map");
  expectRefused("symmetries: {discrete: [{position: [1, 0, 0]}]}", "line 1", "shift");
  expectRefused(
      "symmetries:\n  continuous: {axis: [0, 0, 1]}\n  discrete: [{axis: [1, 0, 0], fold: 4}]\n",
      "line 2", "axis onto itself");
}

TEST_F(ObjectMetadataTest, WhatIsNoYamlOrNoFile) {
  expectRefused("a: [1, 2\nb: 3\n", "line");
  expectRefused("\tmetres_per_unit: 1\n", "line");
  expectRefused("a: *nothing\n", "line");
  expectRefused("---\nmetres_per_unit: 1\n---\nmetres_per_unit: 2\n", "more than one document");
  std::filesystem::remove(path);
  std::filesystem::create_directory(path);
  expectError<std::runtime_error>([&] { readObjectMetadata(path); }, "mug.yaml", "no file");
}

TEST_F(ObjectMetadataTest, APipeOfItsNameIsNotWaitedFor) {
  const std::string pipe = folder.file("pipe.yaml");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  expectError<std::runtime_error>([&] { readObjectMetadata(pipe); }, pipe, "no regular file");
}

// yaml-cpp makes documents of it without end.
TEST_F(ObjectMetadataTest, AFileThatBeginsWithACommaIsRefused) {
  expectRefused(", metres_per_unit: 1\n", "more than one document");
  expectRefused("],", "");
}

TEST_F(ObjectMetadataTest, LongAndDeepFilesAreRefused) {
  expectRefused(std::string(1 << 17, '#'), "at most");
  expectRefused("symmetries: " + std::string(60000, '['), "line 1");
}

TEST_F(ObjectMetadataTest, GoesBeforeWhatTheModelKnows) {
  Field field = smallField();
  field.metadata.metres_per_unit = 1;
  const std::string model = folder.file("mug.safetensors");
  saveModel(field, model);
  EXPECT_EQ(metadataPathOf(model), path);
  EXPECT_EQ(loadField(model).metadata.metres_per_unit, 1);
  // U is turned by a quarter about x, so that its z axis is the model's -y axis.
  read(
      "metres_per_unit: 0.2\n"
      "frame_in_model: {position: [1, 2, 3], orientation: [0.70710678, 0, 0, 0.70710678]}\n"
      "symmetries: {continuous: {axis: [0, 0, 1], point: [1, 0, 0]}}\n");
  for (const FieldMetadata& object : {loadField(model).metadata, readObject(model)}) {
    EXPECT_EQ(object.metres_per_unit, 0.2);
    EXPECT_EQ(object.T_O_U.t, Eigen::Vector3d(1, 2, 3));
    ASSERT_TRUE(object.symmetries.axis());
    EXPECT_LT((object.symmetries.axis()->direction - Eigen::Vector3d(0, -1, 0)).norm(), 1e-7);
    EXPECT_LT((object.symmetries.axis()->point - Eigen::Vector3d(2, 2, 3)).norm(), 1e-7);
  }
  EXPECT_EQ(loadModel(model).metadata.metres_per_unit, 1);
  expectRefused("metres_per_unit: [1]\n", "metres_per_unit");
  expectError<std::runtime_error>([&] { loadField(model); }, "mug.yaml", "metres_per_unit");
}

}  // namespace
}  // namespace nerf_pose_refiner
