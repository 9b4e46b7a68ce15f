// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace nerf_pose_refiner {

/// A segment of a JPEG that holds EXIF data (TIFF 6.0) of one entry, the orientation.
inline std::string exifSegment(int orientation, bool big_endian) {
  const auto number = [big_endian](unsigned value, int bytes) {
    std::string text;
    for (int i = 0; i < bytes; ++i) {
      const int shift = 8 * (big_endian ? bytes - 1 - i : i);
      text += static_cast<char>(value >> shift & 0xff);
    }
    return text;
  };
  const std::string tiff = (big_endian ? "MM" : "II") + number(42, 2) + number(8, 4) +
                           number(1, 2) +                                     // entries
                           number(0x0112, 2) + number(3, 2) + number(1, 4) +  // one short
                           number(static_cast<unsigned>(orientation), 2) + number(0, 2) +
                           number(0, 4);  // no other directory
  const std::string data = std::string("Exif\0\0", 6) + tiff;
  const auto size = static_cast<unsigned>(data.size() + 2);
  return std::string("\xff\xe1") + static_cast<char>(size >> 8) + static_cast<char>(size & 0xff) +
         data;
}

/// The head of a JPEG up to its coded data, with a segment in it.
inline std::string jpegHead(const std::string& segment) {
  return "\xff\xd8" + segment + std::string("\xff\xda\x00\x02", 4);
}

/// A JPEG file with a segment put in behind its first marker.
inline std::string withSegment(const std::string& jpeg, const std::string& segment) {
  return jpeg.substr(0, 2) + segment + jpeg.substr(2);
}

}  // namespace nerf_pose_refiner
