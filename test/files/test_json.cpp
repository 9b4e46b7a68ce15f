// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "files/json.h"

#include <gtest/gtest.h>

#include <stdexcept>
#include <string>

#include "support/expect_error.h"

namespace nerf_pose_refiner {
namespace {

std::string nested(int depth) { return std::string(depth, '[') + "1" + std::string(depth, ']'); }

TEST(ParseJson, ReadsValuesUpToADepth) {
  EXPECT_EQ(parseJson("{\"a\": [1, 2.5, null]}")["a"][1], 2.5);
  EXPECT_NO_THROW(parseJson(nested(64)));
  expectError<std::runtime_error>([] { parseJson(nested(65)); }, "deeper than 64");
  expectError<std::runtime_error>([] { parseJson(nested(500000)); }, "deeper than 64");
  expectError<std::runtime_error>([] { parseJson(std::string(500000, '[')); }, "deeper than 64");
  std::string objects;
  for (int i = 0; i < 100000; ++i) objects += "{\"a\":";
  expectError<std::runtime_error>([&] { parseJson(objects); }, "deeper than 64");
}

TEST(ParseJson, SaysWhatIsWrongInAFewWords) {
  expectError<std::runtime_error>([] { parseJson("{\"a\": }"); }, "parse error");
  expectError<std::runtime_error>([] { parseJson(std::string("{}\0", 3)); }, "zero byte");
  try {
    parseJson("[\"" + std::string(100000, 'x'));
    FAIL();
  } catch (const std::runtime_error& error) {
    EXPECT_LE(std::string(error.what()).size(), 200u);
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
