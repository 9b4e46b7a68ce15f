// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "files/binary_reader.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "support/colmap_files.h"
#include "support/expect_error.h"
#include "support/temporary_folder.h"

namespace nerf_pose_refiner {
namespace {

TEST(BinaryReader, NumbersTextAndGaps) {
  const TemporaryFolder folder;
  Bytes bytes;
  bytes.add<std::uint8_t>(7).add(-2.5).addText("name").add<std::int32_t>(-9).add<char>('x');
  const InputFile file(folder.write("file", bytes.content()));
  BinaryReader reader(file);
  EXPECT_EQ(reader.read<std::uint8_t>(), 7);
  EXPECT_EQ(reader.read<double>(), -2.5);
  EXPECT_EQ(reader.readText(4), "name");
  reader.skip(4);
  EXPECT_EQ(reader.remaining(), 1u);
  EXPECT_THROW(reader.read<std::uint16_t>(), std::runtime_error);
  EXPECT_THROW(reader.skip(2), std::runtime_error);
  EXPECT_EQ(reader.read<char>(), 'x');
  EXPECT_THROW(reader.read<char>(), std::runtime_error);
}

TEST(BinaryReader, FilesLargerThanTheBuffer) {
  const TemporaryFolder folder;
  Bytes bytes;
  bytes.add<char>('.');  // numbers lie across the ends of what is buffered
  for (std::uint32_t i = 0; i < 50000; ++i) bytes.add(i);
  const InputFile file(folder.write("file", bytes.content()));
  BinaryReader reader(file);
  reader.skip(1);
  for (std::uint32_t i = 0; i < 25000; ++i) ASSERT_EQ(reader.read<std::uint32_t>(), i);
  reader.skip(4 * 24999);
  EXPECT_EQ(reader.read<std::uint32_t>(), 49999u);
}

TEST(BinaryReader, WhatTheFileCannotHold) {
  const TemporaryFolder folder;
  const std::string content = Bytes().add<std::uint64_t>(3).content() + std::string(6, 'a');
  const InputFile file(folder.write("file", content));
  EXPECT_EQ(BinaryReader(file).readCount(2), 3u);
  expectError<std::runtime_error>([&] { BinaryReader(file).readCount(3); }, "3 entries");
  BinaryReader text(file);
  text.skip(8);
  expectError<std::runtime_error>([&] { text.readText(5); }, "5 characters");
  BinaryReader endless(file);
  endless.skip(8);
  expectError<std::runtime_error>([&] { endless.readText(100); }, "ends too soon");
}

}  // namespace
}  // namespace nerf_pose_refiner
