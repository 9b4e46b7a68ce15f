// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "files/input_file.h"

namespace nerf_pose_refiner {

/// Width and height [px].
struct ImageSize {
  std::uint32_t width = 0, height = 0;

  std::uint64_t pixels() const { return std::uint64_t{width} * height; }
};

/// Size of a PNG or a JPEG, as its header says. Nothing is decoded, and little is read.
/// @throws std::runtime_error with the reason alone, as InputFile does: not such a file, or a
/// damaged one.
ImageSize readImageSize(const InputFile& file);

}  // namespace nerf_pose_refiner
