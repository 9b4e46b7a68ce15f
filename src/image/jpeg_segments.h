// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <stdexcept>

#include "files/input_file.h"

namespace nerf_pose_refiner {

/// A segment of a JPEG (ITU-T T.81): a marker and data.
struct JpegSegment {
  std::uint8_t code = 0;     ///< the marker's second byte
  std::uint64_t offset = 0;  ///< of the data in the file
  std::uint32_t size = 0;    ///< of the data [bytes]
};

/// Goes through the segments of a JPEG.
/// @param visit is called with each; what it returns true for is the last.
/// @throws std::runtime_error for a file that is damaged or ends before that.
template <typename Visitor>
void visitJpegSegments(const InputFile& file, const Visitor& visit) {
  constexpr int kMaxSegments = 10000;  // a file of nothing else takes long
  std::uint64_t offset = 2;            // behind the marker "start of image"
  for (int i = 0; i < kMaxSegments; ++i) {
    std::uint8_t head[4];
    if (offset + sizeof head > file.size()) break;
    file.read(offset, head, sizeof head);
    if (head[0] != 0xff) break;
    if (head[1] == 0xff) {  // padding
      ++offset;
      continue;
    }
    const std::uint32_t length = std::uint32_t{head[2]} << 8 | head[3];  // itself included
    const JpegSegment segment = {head[1], offset + 4, length < 2 ? 0 : length - 2};
    if (visit(segment)) return;
    offset += 2 + length;
  }
  throw std::runtime_error("a damaged JPEG");
}

}  // namespace nerf_pose_refiner
