// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/object_store.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/expect_error.h"
#include "support/random_field.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;
using Reason = ModelError::Reason;

std::shared_ptr<const Field> smallField(const std::string& name, double metres_per_unit) {
  auto field = std::make_shared<Field>(randomField(smallConfig(), 1));
  field->metadata.name = name;
  field->metadata.metres_per_unit = metres_per_unit;
  field->metadata.diameter = 0.5;
  return field;
}

/// A folder with a folder "models" and a secret beside it.
class ObjectStoreTest : public testing::Test {
 protected:
  ObjectStoreTest() : folder_(temporary_.path()), root_((folder_ / "models").string()) {
    fs::create_directories(folder_ / "models" / "shelf");
    temporary_.write("secret", "secret");
  }

  ObjectStore store() { return ObjectStore(root_, &cache_); }

  std::optional<Reason> reasonFor(const std::string& name) {
    try {
      store().load(name);
    } catch (const ModelError& e) {
      return e.reason();
    }
    return std::nullopt;
  }

  TemporaryFolder temporary_;
  fs::path folder_;
  std::string root_;
  ModelCache cache_;
};

TEST_F(ObjectStoreTest, KeepsObjectNamesPlain) {
  for (const char* good : {"mug", "Mug_2", "a-b.c", "7"}) EXPECT_NO_THROW(requireObjectName(good));
  for (const char* bad :
       {"", ".", "..", ".mug", "-mug", "a/b", "a b", "a\\b", "m\xc3\xbcg", "a\nb"}) {
    EXPECT_THROW(requireObjectName(bad), std::invalid_argument) << bad;
  }
  EXPECT_NO_THROW(requireObjectName(std::string(100, 'a')));
  EXPECT_THROW(requireObjectName(std::string(101, 'a')), std::invalid_argument);
}

TEST_F(ObjectStoreTest, GivesBackWhatItWasGiven) {
  const ObjectStore store((folder_ / "new" / "models").string(), &cache_);
  EXPECT_EQ(store.find("mug"), nullptr);
  store.save(smallField("mug", 0.01));
  EXPECT_TRUE(fs::exists(folder_ / "new" / "models" / "mug.safetensors"));
  EXPECT_EQ(store.load("mug")->metadata.metres_per_unit, 0.01);
}

TEST_F(ObjectStoreTest, CallsAModelByItsFile) {
  store().save(smallField("mug", 0.01));
  fs::rename(folder_ / "models" / "mug.safetensors", folder_ / "models" / "cup.safetensors");
  EXPECT_EQ(store().load("cup")->metadata.name, "cup");
}

TEST_F(ObjectStoreTest, ListsWhatIsInMemoryAndWhatIsNot) {
  EXPECT_TRUE(store().list().empty());
  store().save(smallField("mug", 0.01));
  ObjectStore(root_, std::make_unique<ModelCache>().get()).save(smallField("cup", 0.02));
  temporary_.write("models/broken.safetensors", "not a model");
  temporary_.write("models/notes.txt", "no model at all");
  fs::create_symlink(folder_ / "secret", folder_ / "models" / "leak.safetensors");
  const std::shared_ptr<const Field> used = store().load("mug");
  const std::vector<StoredObject> objects = store().list();
  ASSERT_EQ(objects.size(), 4u);
  EXPECT_EQ(objects[0].name, "broken");
  EXPECT_NE(objects[0].message.find("not a model"), std::string::npos) << objects[0].message;
  EXPECT_EQ(objects[1].name, "cup");
  EXPECT_FALSE(objects[1].in_memory);
  EXPECT_EQ(objects[1].metadata.metres_per_unit, 0.02);
  EXPECT_EQ(objects[1].bytes, fs::file_size(folder_ / "models" / "cup.safetensors"));
  EXPECT_EQ(objects[2].name, "leak");
  EXPECT_NE(objects[2].message.find("leads out of"), std::string::npos) << objects[2].message;
  EXPECT_EQ(objects[3].name, "mug");
  EXPECT_TRUE(objects[3].in_memory && objects[3].in_use);
  EXPECT_EQ(objects[3].bytes, memoryBytes(*used));
  EXPECT_TRUE(objects[3].message.empty());
}

TEST_F(ObjectStoreTest, FreesMemoryOfWhatNobodyUses) {
  store().save(smallField("mug", 0.01));
  std::shared_ptr<const Field> used = store().load("mug");
  expectError<std::runtime_error>([&] { store().unload("mug"); }, "mug", "in use");
  used.reset();
  store().unload("mug");
  EXPECT_FALSE(store().list().at(0).in_memory);
  expectError<std::runtime_error>([&] { store().unload("mug"); }, "mug", "not in memory");
  EXPECT_THROW(store().unload("../mug"), std::invalid_argument);
}

TEST_F(ObjectStoreTest, SaysWhyAModelCannotBeUsed) {
  EXPECT_EQ(reasonFor("mug"), Reason::kUnreadable) << "there is none";
  store().save(smallField("mug", 0.01));
  EXPECT_EQ(reasonFor("../models/mug"), Reason::kUnreadable) << "a path, not a name";
  temporary_.write("models/broken.safetensors", "not a model");
  EXPECT_EQ(reasonFor("broken"), Reason::kUnreadable);
  fs::create_symlink(folder_ / "secret", folder_ / "models" / "leak.safetensors");
  EXPECT_EQ(reasonFor("leak"), Reason::kUnreadable);
  store().save(smallField("unscaled", 0));
  EXPECT_EQ(reasonFor("unscaled"), Reason::kNoScale);
  EXPECT_NE(store().find("unscaled"), nullptr);
  EXPECT_THROW(ObjectStore("", &cache_).load("mug"), ModelError) << "no root is set";
}

TEST_F(ObjectStoreTest, KnowsWhatIsSaidOfAnObjectBesideItsModel) {
  store().save(smallField("mug", 0));
  temporary_.write("models/mug.yaml", "metres_per_unit: 0.03\n");
  EXPECT_EQ(store().load("mug")->metadata.metres_per_unit, 0.03);
  EXPECT_EQ(store().save(smallField("mug", 5))->metadata.metres_per_unit, 0.03) << "learned again";
  temporary_.write("models/mug.yaml", "metres: 1\n");
  EXPECT_EQ(reasonFor("mug"), Reason::kUnreadable);
  expectError<std::runtime_error>([&] { store().metadataOf("mug"); }, "mug.yaml", "'metres'");
  temporary_.write("models/cup.yaml", "metres: 1\n");
  fs::copy_file(folder_ / "models" / "mug.safetensors", folder_ / "models" / "cup.safetensors");
  EXPECT_NE(store().list().at(0).message.find("'metres'"), std::string::npos);
  fs::remove(folder_ / "models" / "cup.yaml");
  fs::create_symlink(folder_ / "secret", folder_ / "models" / "cup.yaml");
  EXPECT_EQ(reasonFor("cup"), Reason::kUnreadable) << "it leads out of the root";
}

TEST_F(ObjectStoreTest, ReadsWhatIsSaidBesideALink) {
  store().save(smallField("mug", 0.01));
  fs::create_symlink("mug.safetensors", folder_ / "models" / "small_mug.safetensors");
  temporary_.write("models/small_mug.yaml", "metres_per_unit: 0.005\n");
  const std::shared_ptr<const Field> mug = store().load("mug"), small = store().load("small_mug");
  EXPECT_EQ(mug->metadata.metres_per_unit, 0.01);
  EXPECT_EQ(small->metadata.metres_per_unit, 0.005);
  const std::vector<StoredObject> objects = store().list();
  ASSERT_EQ(objects.size(), 2u);
  EXPECT_EQ(objects[1].name, "small_mug");
  EXPECT_EQ(objects[1].metadata.metres_per_unit, 0.005);
}

TEST_F(ObjectStoreTest, WritesBelowItsRootOnly) {
  const ObjectStore store = this->store();
  EXPECT_THROW(store.save(smallField("../mug", 0.01)), std::invalid_argument);
  fs::create_symlink(folder_ / "elsewhere", folder_ / "models" / "trap.safetensors");
  EXPECT_THROW(store.save(smallField("trap", 0.01)), std::invalid_argument);
  EXPECT_FALSE(fs::exists(folder_ / "elsewhere"));
}

}  // namespace
}  // namespace nerf_pose_refiner
