// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/orientation.h"

#include <algorithm>
#include <cstring>
#include <vector>

#include "image/jpeg_segments.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::uint8_t kApplication1 = 0xe1, kStartOfScan = 0xda;
constexpr std::size_t kTiffOffset = 6;  // behind "Exif" and two zero bytes
constexpr std::size_t kEntryBytes = 12;
constexpr std::uint32_t kOrientationTag = 0x0112, kShort = 3;

/// Numbers of a TIFF, which says itself in what order their bytes are. Zero behind its end.
class Tiff {
 public:
  explicit Tiff(const std::vector<std::uint8_t>& bytes)
      : bytes_(bytes), big_endian_(at(kTiffOffset) == 'M') {}

  std::uint32_t number16(std::size_t offset) const {
    const std::uint32_t a = at(kTiffOffset + offset), b = at(kTiffOffset + offset + 1);
    return big_endian_ ? a << 8 | b : b << 8 | a;
  }

  std::uint32_t number32(std::size_t offset) const {
    const std::uint32_t a = number16(offset), b = number16(offset + 2);
    return big_endian_ ? a << 16 | b : b << 16 | a;
  }

 private:
  std::uint32_t at(std::size_t i) const { return i < bytes_.size() ? bytes_[i] : 0; }

  const std::vector<std::uint8_t>& bytes_;
  bool big_endian_;
};

/// The orientation in the first directory of EXIF data, or 1.
int orientationIn(const std::vector<std::uint8_t>& exif) {
  const Tiff tiff(exif);
  const std::size_t directory = tiff.number32(4);
  const std::uint32_t entries = tiff.number16(directory);
  for (std::uint32_t i = 0; i < entries; ++i) {
    const std::size_t entry = directory + 2 + i * kEntryBytes;
    if (tiff.number16(entry) != kOrientationTag || tiff.number16(entry + 2) != kShort) continue;
    const std::uint32_t value = tiff.number16(entry + 8);
    return value >= 1 && value <= 8 ? static_cast<int>(value) : 1;
  }
  return 1;
}

}  // namespace

int readExifOrientation(const InputFile& file) {
  std::uint8_t start[2] = {};
  if (file.size() < sizeof start) return 1;
  file.read(0, start, sizeof start);
  if (start[0] != 0xff || start[1] != 0xd8) return 1;  // no JPEG
  int orientation = 1;
  visitJpegSegments(file, [&](const JpegSegment& segment) {
    if (segment.code != kApplication1) return segment.code == kStartOfScan;
    std::vector<std::uint8_t> bytes(
        std::min<std::uint64_t>(segment.size, file.size() - segment.offset));
    file.read(segment.offset, bytes.data(), bytes.size());
    const bool exif = bytes.size() > kTiffOffset && std::memcmp(bytes.data(), "Exif\0", 6) == 0;
    if (exif) orientation = orientationIn(bytes);
    return exif;
  });
  return orientation;
}

Image8 upright(const Image8& image, int orientation) {
  const bool exchange = exchangesSides(orientation);
  const bool flip_x = orientation == 2 || orientation == 3 || orientation >= 7;
  const bool flip_y = orientation == 3 || orientation == 4 || orientation == 6 || orientation == 7;
  Image8 result(exchange ? image.height : image.width, exchange ? image.width : image.height,
                image.channels);
  for (int y = 0; y < result.height; ++y) {
    for (int x = 0; x < result.width; ++x) {
      const int u = exchange ? y : x, v = exchange ? x : y;
      const std::uint8_t* from =
          image.pixel(flip_x ? image.width - 1 - u : u, flip_y ? image.height - 1 - v : v);
      std::copy_n(from, image.channels, result.pixel(x, y));
    }
  }
  return result;
}

}  // namespace nerf_pose_refiner
