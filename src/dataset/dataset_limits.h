// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <stdexcept>
#include <string>

#include "dataset/dataset.h"

namespace nerf_pose_refiner {

constexpr std::uint64_t kMega = 1000000;

/// Calls `visit(name, value, meaning)` for each limit that users set, in the units that they set it
/// in, and stores what the visitor leaves in `value`.
/// @throws std::invalid_argument naming a limit that is zero.
template <typename Visitor>
void visitLimits(DatasetLimits* limits, Visitor&& visit) {
  const auto visitOne = [&visit](const char* name, std::uint64_t* limit, std::uint64_t unit,
                                 const char* meaning) {
    std::uint64_t value = *limit / unit;
    visit(name, value, meaning);
    if (value == 0) throw std::invalid_argument(std::string(name) + " is 0, must be at least 1");
    *limit = value * unit;
  };
  visitOne("max_photos", &limits->frames, 1, "Photos of a dataset, at most");
  visitOne("max_photo_megapixels", &limits->image_pixels, kMega,
           "Pixels of a photo or a mask, at most [10^6]");
  visitOne("max_megapixels", &limits->pixels, kMega,
           "Pixels of all photos, at most [10^6]; they take 4 bytes each");
  visitOne("max_megabytes", &limits->image_bytes, kMega,
           "Size of the files of all photos and masks, at most [10^6 bytes]");
}

}  // namespace nerf_pose_refiner
