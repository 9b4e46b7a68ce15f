// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <gtest/gtest.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>

#include "support/temporary_folder.h"

namespace nerf_pose_refiner {

/// Feeds a fuzzer's target with all inputs of its corpus: valid forms, and what once broke it.
inline void replayInputs(const std::string& name,
                         void (*target)(const std::uint8_t*, std::size_t)) {
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

}  // namespace nerf_pose_refiner
