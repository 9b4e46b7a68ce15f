// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "support/temporary_folder.h"
#include "targets.h"

namespace nerf_pose_refiner {
namespace {

/// Feeds a target with all inputs of its corpus: valid forms, and what once broke it.
void replay(const std::string& name, void (*target)(const std::uint8_t*, std::size_t)) {
  int inputs = 0;
  const std::string folder = NPR_SOURCE_DIR "/fuzz/corpus/" + name;
  for (const auto& file : std::filesystem::directory_iterator(folder)) {
    const std::string bytes = readFile(file.path().string());
    SCOPED_TRACE(file.path().filename());
    EXPECT_NO_THROW(target(reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()));
    ++inputs;
  }
  EXPECT_GE(inputs, 2) << folder;
}

TEST(FuzzCorpus, BopScene) { replay("bop_scene", fuzzBopScene); }
TEST(FuzzCorpus, ColmapBinary) { replay("colmap_binary", fuzzColmapBinary); }
TEST(FuzzCorpus, ColmapText) { replay("colmap_text", fuzzColmapText); }
TEST(FuzzCorpus, ModelFile) { replay("model_file", fuzzModelFile); }
TEST(FuzzCorpus, ObjectMetadata) { replay("object_metadata", fuzzObjectMetadata); }
TEST(FuzzCorpus, PhoneScan) { replay("phone_scan", fuzzPhoneScan); }
TEST(FuzzCorpus, TransformsJson) { replay("transforms_json", fuzzTransformsJson); }
TEST(FuzzCorpus, ImageSize) { replay("image_size", fuzzImageSize); }

}  // namespace
}  // namespace nerf_pose_refiner
