// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/model_cache.h"

#include <gtest/gtest.h>

#include <chrono>
#include <filesystem>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "field/model_file.h"
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
                                  "has limited the memory of models");
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
  EXPECT_EQ(cache.put(path, field), field);
  EXPECT_EQ(cache.load(path), field);
  EXPECT_EQ(cache.filesRead(), 0u);
}

TEST_F(ModelCacheTest, WhatIsSaidOfAnObjectHoldsForOneThatWasJustWritten) {
  folder.write("mug.yaml", "metres_per_unit: 7\n");
  const std::string path = write("mug");
  const auto described = cache.put(path, std::make_shared<const Field>(smallField()));
  EXPECT_EQ(described->metadata.metres_per_unit, 7);
  EXPECT_EQ(cache.load(path), described);
}

TEST_F(ModelCacheTest, OtherMetadataComesWithoutReadingTheModelAgain) {
  const std::string path = write("mug", 5);
  const auto before = cache.load(path);
  folder.write("mug.yaml", "metres_per_unit: 0.5\n");
  const auto after = cache.load(path);
  EXPECT_EQ(after->metadata.metres_per_unit, 0.5);
  EXPECT_EQ(after->metadata.seed, 5u);
  EXPECT_EQ(after->metadata.name, "mug");
  EXPECT_EQ(after->grid, before->grid);
  EXPECT_EQ(cache.filesRead(), 1u);
  EXPECT_FALSE(cache.list().at(0).outdated);
  folder.write("mug.yaml", "metres: 0.5\n");
  expectError<std::runtime_error>([&] { cache.load(path); }, "mug.yaml", "'metres'");
  fs::remove(folder.file("mug.yaml"));
  EXPECT_EQ(cache.load(path)->metadata.metres_per_unit, before->metadata.metres_per_unit);
}

/// What `renewed` says once it believes that a file is whole.
std::shared_ptr<const Field> settled(ModelCache* cache, const std::shared_ptr<const Field>& field) {
  EXPECT_EQ(cache->renewed(field), nullptr) << "it may be half written";
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(5);
  while (std::chrono::steady_clock::now() < deadline) {
    if (auto renewed = cache->renewed(field)) return renewed;
    std::this_thread::yield();
  }
  return nullptr;
}

TEST_F(ModelCacheTest, RenewsMetadataOfAModelInUse) {
  const std::string path = write("mug");
  const auto before = cache.load(path);
  EXPECT_EQ(cache.renewed(before), nullptr);
  folder.write("mug.yaml", "metres_per_unit: 0.5\n");
  const auto after = settled(&cache, before);
  ASSERT_TRUE(after);
  EXPECT_EQ(after->metadata.metres_per_unit, 0.5);
  EXPECT_EQ(cache.load(path), after);
  EXPECT_EQ(cache.renewed(before), after) << "for another refiner, which has the old one yet";
}

TEST_F(ModelCacheTest, BadMetadataIsReportedOnceAndTheOldOneServes) {
  const std::string path = write("mug");
  const auto before = cache.load(path);
  folder.write("mug.yaml", "bounding_box: 3\n");
  expectError<std::runtime_error>([&] { settled(&cache, before); }, "mug.yaml", "bounding_box");
  for (int i = 0; i < 10; ++i) EXPECT_EQ(cache.renewed(before), nullptr);
  EXPECT_NE(cache.list().at(0).metadata_error.find("bounding_box"), std::string::npos);
  folder.write("mug.yaml", "metres_per_unit: 3\n");
  const auto after = settled(&cache, before);
  ASSERT_TRUE(after);
  EXPECT_EQ(after->metadata.metres_per_unit, 3);
}

TEST_F(ModelCacheTest, LosingItsScaleIsAnErrorToo) {
  Field field = smallField();
  field.metadata.metres_per_unit = 0;
  const std::string path = folder.file("mug.safetensors");
  saveModel(field, path);
  folder.write("mug.yaml", "metres_per_unit: 0.5\n");
  const auto before = cache.load(path);
  fs::remove(folder.file("mug.yaml"));
  expectError<std::runtime_error>([&] { settled(&cache, before); }, "mug", "metres_per_unit");
  EXPECT_EQ(cache.renewed(before), nullptr);
}

}  // namespace
}  // namespace nerf_pose_refiner
