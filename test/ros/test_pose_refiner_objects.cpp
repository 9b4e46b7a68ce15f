// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
// Objects in memory and on disk, while the refiner is at work.
#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>

#include "pose_refiner_graph.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

fs::path modelFile(const std::string& name) {
  return fs::path(world->root) / "models" / (name + ".safetensors");
}

fs::path metadataFile(const std::string& name) {
  return fs::path(world->root) / "models" / (name + ".yaml");
}

/// As an editor does it: the new file takes the place of the old one at once.
void putInPlace(const fs::path& from, const fs::path& to) {
  fs::copy_file(from, to.string() + ".new", fs::copy_options::overwrite_existing);
  fs::rename(to.string() + ".new", to);
}

class ObjectsTest : public PoseRefinerTest {
 protected:
  void SetUp() override {
    ASSERT_TRUE(setObject("toy").success);
    PoseRefinerTest::SetUp();
  }

  void TearDown() override {
    EXPECT_TRUE(setObject("toy").success);
    fs::remove(modelFile("spare"));
    fs::remove(metadataFile("spare"));
  }
};

TEST_F(ObjectsTest, AreListedLoadedChosenAndUnloaded) {
  fs::copy_file(modelFile("toy"), modelFile("spare"));
  auto info = infoOf("spare");
  ASSERT_TRUE(info);
  EXPECT_FALSE(info->in_memory || info->in_use || info->tracked);
  EXPECT_EQ(info->bytes, fs::file_size(modelFile("spare")));
  EXPECT_EQ(info->metres_per_unit, kMetresPerUnit);
  EXPECT_NEAR(info->diameter_m, 0.1, 0.02);
  EXPECT_GT(info->psnr_db, 20);
  info = infoOf("toy");
  ASSERT_TRUE(info);
  EXPECT_TRUE(info->in_memory && info->in_use && info->tracked) << *info;
  EXPECT_GE(listObjects().memory_bytes, info->bytes);

  const LoadObject load = loadNamed("spare");
  EXPECT_TRUE(load.response.success) << load.response.message;
  EXPECT_TRUE(infoOf("spare")->in_memory);
  EXPECT_FALSE(infoOf("spare")->tracked) << "another one is";
  const UnloadObject::Response in_use = unloadObject("toy");
  EXPECT_FALSE(in_use.success);
  EXPECT_NE(in_use.message.find("in use"), std::string::npos) << in_use.message;

  EXPECT_TRUE(setObject("spare").success);
  EXPECT_TRUE(infoOf("spare")->tracked && !infoOf("toy")->tracked);
  ASSERT_TRUE(track());
  EXPECT_EQ(world->status.last()->object, "spare");
  EXPECT_TRUE(setObject("toy").success);
  // The overlay's thread may hold it for a moment more.
  EXPECT_TRUE(waitUntil([] { return !infoOf("spare")->in_use; }));
  EXPECT_TRUE(unloadObject("spare").success);
  EXPECT_FALSE(infoOf("spare")->in_memory);
  const SetObject::Response none = setObject("no_such_object");
  EXPECT_FALSE(none.success);
  EXPECT_NE(none.message.find("no_such_object"), std::string::npos);
  EXPECT_TRUE(infoOf("toy")->tracked) << "as it was";
}

// The frame of the object is moved while it is tracked, and then the file is spoilt.
TEST_F(ObjectsTest, WhatIsSaidOfItIsReadAgain) {
  fs::copy_file(modelFile("toy"), modelFile("spare"));
  ASSERT_TRUE(setObject("spare").success);
  ASSERT_TRUE(track());
  const std::uint64_t read = listObjects().files_read;
  world->status.clear();
  std::ofstream(metadataFile("spare"))
      << "frame_in_model: {position: [0, 0, 1], orientation: [0, 0, 1, 0]}\n"
         "bounding_box: {min: [-1, -1, -1], max: [1, 1, 2]}\n"
         "symmetries: {discrete: [{axis: [0, 0, 1], fold: 2}]}\n";
  const Pose moved = world->truth() * Pose(expSO3({0, 0, M_PI}), {0, 0, kMetresPerUnit});
  const auto isMoved = [&](const geometry_msgs::PoseStamped& message) {
    const Pose pose = fromMessage(message.pose);
    return rotationDistance(pose.R, moved.R) < 0.04 && (pose.t - moved.t).norm() < 0.004;
  };
  ASSERT_TRUE(world->poses.wait(isMoved)) << "its frame is another one now";
  const auto info = infoOf("spare");
  EXPECT_NEAR(info->frame_in_model.position.z, kMetresPerUnit, 1e-12);
  EXPECT_NEAR(info->box_max.z, 2 * kMetresPerUnit, 1e-12);
  EXPECT_EQ(info->symmetries, "1 motion");
  EXPECT_TRUE(info->tracked);
  std::ofstream(metadataFile("spare")) << "frame_in_model: nowhere\n";
  ASSERT_TRUE(waitUntil([] { return !infoOf("spare")->message.empty(); }));
  EXPECT_NE(infoOf("spare")->message.find("line 1: frame_in_model"), std::string::npos)
      << infoOf("spare")->message;
  world->poses.clear();
  const auto pose = world->poses.wait();
  ASSERT_TRUE(pose);
  EXPECT_TRUE(isMoved(*pose)) << "the last that was good serves";
  EXPECT_EQ(listObjects().files_read, read);
  EXPECT_FALSE(setObject("spare").success) << "asked for, it is an error";
  EXPECT_EQ(world->status.last()->state, Status::STATE_TRACKING) << "all the time";
}

TEST_F(ObjectsTest, AModelFileIsSwappedUnderIt) {
  fs::copy_file(modelFile("toy"), modelFile("spare"));
  ASSERT_TRUE(setObject("spare").success);
  ASSERT_TRUE(track());
  const std::uint64_t read = listObjects().files_read;
  putInPlace(modelFile("toy"), modelFile("spare"));
  world->poses.clear();
  ASSERT_TRUE(world->poses.wait()) << "the one in use stays whole";
  EXPECT_EQ(listObjects().files_read, read);
  ASSERT_TRUE(setObject("spare").success);
  EXPECT_EQ(listObjects().files_read, read + 1) << "read again";
  world->poses.clear();
  EXPECT_TRUE(track());
  fs::resize_file(modelFile("spare"), 1000);
  const SetObject::Response damaged = setObject("spare");
  EXPECT_FALSE(damaged.success);
  EXPECT_NE(damaged.message.find("spare.safetensors"), std::string::npos) << damaged.message;
  world->poses.clear();
  EXPECT_TRUE(world->poses.wait());
}

}  // namespace
}  // namespace nerf_pose_refiner
