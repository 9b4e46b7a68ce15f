// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <stdexcept>
#include <string>

#include "field/model_file.h"
#include "support/expect_error.h"
#include "support/small_field.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

/// A file of a header alone.
std::string withHeader(const std::string& text) {
  const std::uint64_t length = text.size();
  return std::string(reinterpret_cast<const char*>(&length), 8) + text;
}

std::string nested(int depth) { return std::string(depth, '[') + std::string(depth, ']'); }

// Copying or printing such a value takes a frame of the stack for each bracket.
TEST(ModelFileFaults, DeepHeadersAreRefused) {
  const TemporaryFolder folder;
  const auto expectRefused = [&](const std::string& metadata, const std::string& reason) {
    const std::string header =
        R"({"__metadata__": {"format": "nerf_pose_refiner", )" + metadata + "}}";
    const std::string path = folder.write("deep.safetensors", withHeader(header));
    expectError<std::runtime_error>([&] { loadModel(path); }, path, reason);
    expectError<std::runtime_error>([&] { readModelMetadata(path); }, path, reason);
  };
  expectRefused("\"version\": " + nested(500000), "no header");
  expectRefused("\"version\": " + nested(30000), "nest deeper");
  expectRefused(R"("version": "1", "field": ")" + nested(30000) + "\"", "nest deeper");
}

TEST(ModelFileFaults, APipeOfItsNameIsNotWaitedFor) {
  const TemporaryFolder folder;
  const std::string pipe = folder.file("pipe.safetensors");
  ASSERT_EQ(mkfifo(pipe.c_str(), 0600), 0);
  expectError<std::runtime_error>([&] { loadModel(pipe); }, pipe, "no regular file");
  expectError<std::runtime_error>([&] { readModelMetadata(pipe); }, pipe, "no regular file");
}

TEST(ModelFileFaults, RoomForAModelIsCheckedBeforeThereIsOne) {
  const TemporaryFolder folder;
  const FieldConfig config = FieldConfig::named("cpu");
  const std::string path = folder.write("cup.safetensors", "old");
  EXPECT_NO_THROW(requireModelWritable(config, path));
  EXPECT_EQ(readFile(path), "old");
  const std::string nowhere = folder.path() + "/none/cup.safetensors";
  expectError<std::runtime_error>([&] { requireModelWritable(config, nowhere); }, nowhere,
                                  "No such file");
  rlimit before;
  getrlimit(RLIMIT_FSIZE, &before);
  const auto ignored = signal(SIGXFSZ, SIG_IGN);
  const rlimit little = {3000000, before.rlim_max};  // the grid alone has more
  setrlimit(RLIMIT_FSIZE, &little);
  expectError<std::runtime_error>([&] { requireModelWritable(config, path); }, path,
                                  "File too large");
  setrlimit(RLIMIT_FSIZE, &before);
  signal(SIGXFSZ, ignored);
}

TEST(ModelFileFaults, ANameThatIsTooLongToBeReadAgainIsNotWritten) {
  const TemporaryFolder folder;
  Field field = smallField();
  field.metadata.name = std::string(100000, 'x');
  const std::string path = folder.file("cup.safetensors");
  expectError<std::runtime_error>([&] { saveModel(field, path); }, path, "too long");
}

}  // namespace
}  // namespace nerf_pose_refiner
