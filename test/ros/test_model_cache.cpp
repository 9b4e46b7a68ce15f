// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/ros/model_cache.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "nerf_pose_refiner/field/model_file.h"
#include "support/expect_error.h"
#include "support/small_field.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

class ModelCacheTest : public testing::Test {
 protected:
  /// Writes a model that can be told from others by its seed.
  std::string write(const std::string& name, std::uint64_t seed = 1) {
    Field field = smallField();
    field.metadata.seed = seed;
    const std::string path = folder.file(name + ".safetensors");
    saveModel(field, path);
    return path;
  }

  std::vector<std::string> names() const {
    std::vector<std::string> names;
    for (const CachedModel& model : cache.list()) names.push_back(model.metadata.name);
    return names;
  }

  TemporaryFolder folder;
  ModelCache cache;
};

TEST_F(ModelCacheTest, ReadsAFileOnce) {
  const std::string path = write("mug");
  const auto first = cache.load(path);
  EXPECT_EQ(first->metadata.name, "mug");
  std::vector<std::thread> threads;
  for (int i = 0; i < 4; ++i) threads.emplace_back([&] { EXPECT_EQ(cache.load(path), first); });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(cache.filesRead(), 1u);
}

TEST_F(ModelCacheTest, AFileSwappedUnderItIsReadAnewAndTheOldOneStaysWhole) {
  const std::string path = write("mug", 1);
  auto old = cache.load(path);
  write("mug", 2);
  EXPECT_TRUE(cache.list().at(0).outdated);
  const auto fresh = cache.load(path);
  EXPECT_EQ(fresh->metadata.seed, 2u);
  EXPECT_EQ(old->metadata.seed, 1u);
  old->validate();
  EXPECT_EQ(cache.list().size(), 2u) << "the old one is in use and takes memory";
  old.reset();
  EXPECT_EQ(cache.list().size(), 1u);
  write("mug", 3);
  EXPECT_EQ(cache.load(path)->metadata.seed, 3u);
  EXPECT_EQ(cache.list().size(), 2u) << "seed 1 is gone, seed 2 is in use";
  fs::remove(path);
  expectError<std::runtime_error>([&] { cache.load(path); }, "mug.safetensors", "No such file");
}

TEST_F(ModelCacheTest, TheLeastRecentlyUsedMakesRoom) {
  const std::size_t bytes = fs::file_size(write("a"));
  cache.setBudget(2 * bytes, "/refiner");
  cache.load(write("a"));
  cache.load(write("b"));
  cache.load(folder.file("a.safetensors"));
  cache.load(write("c"));
  EXPECT_EQ(names(), (std::vector<std::string>{"a", "c"}));
}

TEST_F(ModelCacheTest, WhatIsInUseStays) {
  const std::size_t bytes = fs::file_size(write("a"));
  cache.setBudget(2 * bytes, "/refiner");
  const auto a = cache.load(write("a"));
  auto b = cache.load(write("b"));
  expectError<std::runtime_error>([&] { cache.load(write("c")); }, "c.safetensors", "/refiner",
                                  "~model_memory_mb");
  b.reset();
  cache.load(write("c"));
  EXPECT_EQ(names(), (std::vector<std::string>{"a", "c"}));
}

TEST_F(ModelCacheTest, ThereIsOneBudget) {
  cache.setBudget(0, "/any");
  cache.setBudget(2000000, "/first");
  cache.setBudget(2000000, "/same");
  cache.setBudget(0, "/any");
  expectError<std::invalid_argument>([&] { cache.setBudget(3000000, "/second"); }, "/first", "2",
                                     "/second", "3");
}

TEST_F(ModelCacheTest, GivesBackMemoryThatNobodyUses) {
  const std::string path = write("mug");
  auto field = cache.load(path);
  expectError<std::runtime_error>([&] { cache.unload(path); }, "mug", "in use");
  const std::weak_ptr<const Field> memory = field;
  field.reset();
  EXPECT_TRUE(cache.unload(path));
  EXPECT_TRUE(memory.expired());
  EXPECT_FALSE(cache.unload(path));
}

TEST_F(ModelCacheTest, KnowsWhatWasJustWritten) {
  auto field = std::make_shared<const Field>(smallField());
  const std::string path = write("mug");
  cache.put(path, field);
  EXPECT_EQ(cache.load(path), field);
  EXPECT_EQ(cache.filesRead(), 0u);
}

}  // namespace
}  // namespace nerf_pose_refiner
