// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "math/checksum.h"

#include <gtest/gtest.h>

namespace nerf_pose_refiner {
namespace {

std::string checksumOf(const std::string& text) {
  Checksum checksum;
  checksum.add(text.data(), text.size());
  return checksum.text();
}

TEST(Checksum, PublishedValues) {
  EXPECT_EQ(checksumOf(""), "cbf29ce484222325");
  EXPECT_EQ(checksumOf("a"), "af63dc4c8601ec8c");
  EXPECT_EQ(checksumOf("foobar"), "85944171f73967e8");
}

TEST(Checksum, PiecesMakeTheSameWhole) {
  Checksum checksum;
  checksum.add("foo", 3);
  checksum.add("bar", 3);
  EXPECT_EQ(checksum.value(), 0x85944171f73967e8u);
}

}  // namespace
}  // namespace nerf_pose_refiner
