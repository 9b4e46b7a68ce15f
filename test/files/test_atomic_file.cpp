// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "files/atomic_file.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <ctime>
#include <filesystem>
#include <stdexcept>
#include <vector>

#include "support/expect_error.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

std::vector<std::string> filesIn(const TemporaryFolder& folder) {
  std::vector<std::string> names;
  for (const auto& file : fs::directory_iterator(folder.path())) {
    names.push_back(file.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  return names;
}

using Names = std::vector<std::string>;

/// Another process that dies while it writes.
void writeAndDie(const std::string& path) {
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    AtomicFile file(path);
    file.write("half", 4);
    _exit(0);  // no destructor
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
}

TEST(AtomicFile, WhatAKilledWriterLeftIsRemovedByTheNextOfTheSameFile) {
  const TemporaryFolder folder;
  const std::string path = folder.file("cup");
  writeAndDie(path);
  ASSERT_EQ(filesIn(folder).size(), 1u);
  { AtomicFile(folder.file("mug")); }  // another file's
  ASSERT_EQ(filesIn(folder).size(), 1u);
  AtomicFile file(path);
  file.write("whole", 5);
  file.commit();
  EXPECT_EQ(filesIn(folder), Names{"cup"});
  EXPECT_EQ(readFile(path), "whole");
}

TEST(AtomicFile, WhatIsBeingWrittenStays) {
  const TemporaryFolder folder;
  const std::string path = folder.file("cup");
  AtomicFile first(path);
  first.write("first", 5);
  AtomicFile second(path);
  second.write("second", 6);
  EXPECT_EQ(filesIn(folder).size(), 2u);
  second.commit();
  first.commit();
  EXPECT_EQ(readFile(path), "first");
  EXPECT_EQ(filesIn(folder), Names{"cup"});
}

// A writer on another machine may hold a lock after its death.
TEST(AtomicFile, AfterADayALockDoesNotCount) {
  const TemporaryFolder folder;
  const std::string path = folder.file("cup");
  const AtomicFile first(path);
  ASSERT_EQ(filesIn(folder).size(), 1u);
  const std::string temporary = folder.file(filesIn(folder)[0]);
  const timespec times[] = {{0, UTIME_NOW}, {std::time(nullptr) - 2 * 24 * 60 * 60, 0}};
  ASSERT_EQ(utimensat(AT_FDCWD, temporary.c_str(), times, 0), 0);
  { AtomicFile second(path); }
  EXPECT_EQ(filesIn(folder), Names{});
}

TEST(AtomicFile, OtherNamesStay) {
  const TemporaryFolder folder;
  for (const char* name : {"cup.tmp", "cup.tmpx", "cup.tmp1_0.bak", "mycup.tmp1_0", "cup.yaml"}) {
    folder.write(name, "");
  }
  folder.write("cup.tmp1_0", "");
  fs::create_directory(folder.path() + "/cup.tmp1_1");
  { AtomicFile(folder.file("cup")); }
  EXPECT_EQ(filesIn(folder), (Names{"cup.tmp", "cup.tmp1_0.bak", "cup.tmp1_1", "cup.tmpx",
                                    "cup.yaml", "mycup.tmp1_0"}));
}

TEST(RequireWritable, FindsFoldersAndDisksThatTakeNoFile) {
  const TemporaryFolder folder;
  const std::string path = folder.write("cup", "old");
  EXPECT_NO_THROW(requireWritable(path, 1000));
  EXPECT_EQ(filesIn(folder), Names{"cup"});
  EXPECT_EQ(readFile(path), "old");
  expectError<std::runtime_error>([&] { requireWritable(path, std::uint64_t{1} << 60); },
                                  "cannot write", path);
  expectError<std::runtime_error>([&] { requireWritable(folder.path() + "/none/cup", 1); },
                                  "none/cup", "No such file");
  expectError<std::runtime_error>([&] { requireWritable("/proc/cup", 1); }, "/proc/cup");
  EXPECT_EQ(filesIn(folder), Names{"cup"});
}

}  // namespace
}  // namespace nerf_pose_refiner
