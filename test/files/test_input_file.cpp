// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "files/input_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>

#include <stdexcept>

#include "support/expect_error.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

TEST(InputFile, ReadsAnyPart) {
  const TemporaryFolder folder;
  const InputFile file(folder.write("a", "0123456789"));
  EXPECT_EQ(file.size(), 10u);
  char part[4] = {};
  file.read(3, part, 3);
  EXPECT_STREQ(part, "345");
  expectError<std::runtime_error>([&] { file.read(8, part, 3); }, "ends too soon");
}

TEST(InputFile, ReadsAWholeFileOfALimitedSize) {
  const TemporaryFolder folder;
  const std::string path = folder.write("a", "0123456789");
  EXPECT_EQ(readWhole(InputFile(path), 10), "0123456789");
  EXPECT_EQ(readWhole(InputFile(folder.write("empty", "")), 10), "");
  expectError<std::runtime_error>([&] { readWhole(InputFile(path), 9); }, "10 bytes", "at most 9");
}

// Opening a pipe whose other end nobody has would wait for ever.
TEST(InputFile, RefusesWhatIsNoFileAtOnce) {
  const TemporaryFolder folder;
  ASSERT_EQ(mkfifo(folder.file("pipe").c_str(), 0600), 0);
  expectError<std::runtime_error>([&] { InputFile(folder.file("pipe")); }, "no regular file");
  expectError<std::runtime_error>([&] { InputFile("/dev/null"); }, "no regular file");
  expectError<std::runtime_error>([&] { InputFile(folder.path()); }, "directory");
  expectError<std::runtime_error>([&] { InputFile(folder.file("none")); }, "No such file");
}

}  // namespace
}  // namespace nerf_pose_refiner
