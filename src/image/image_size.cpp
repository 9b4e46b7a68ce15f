// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "image/image_size.h"

#include <array>
#include <cstring>
#include <stdexcept>
#include <string>

#include "image/jpeg_segments.h"

namespace nerf_pose_refiner {
namespace {

[[noreturn]] void failDamaged() {
  throw std::runtime_error("not an image that can be read (PNG or JPEG), or a damaged one");
}

template <std::size_t n>
std::array<std::uint8_t, n> bytesAt(const InputFile& file, std::uint64_t offset) {
  std::array<std::uint8_t, n> bytes;
  if (offset + n > file.size()) failDamaged();
  file.read(offset, bytes.data(), n);
  return bytes;
}

std::uint32_t bigEndian16(const std::uint8_t* b) { return std::uint32_t{b[0]} << 8 | b[1]; }

std::uint32_t bigEndian32(const std::uint8_t* b) {
  return bigEndian16(b) << 16 | bigEndian16(b + 2);
}

/// The first chunk of a PNG is its header: signature, length, "IHDR", width, height.
ImageSize pngSize(const InputFile& file) {
  const auto head = bytesAt<24>(file, 0);
  if (std::memcmp(head.data(), "\x89PNG\r\n\x1a\n\0\0\0\rIHDR", 16) != 0) failDamaged();
  return ImageSize{bigEndian32(&head[16]), bigEndian32(&head[20])};
}

/// A JPEG (ITU-T T.81) has its size in the frame header, behind any number of other segments.
ImageSize jpegSize(const InputFile& file) {
  ImageSize size;
  visitJpegSegments(file, [&](const JpegSegment& segment) {
    const std::uint8_t code = segment.code;
    const bool other = code == 0xc4 || code == 0xc8 || code == 0xcc;  // no frame headers
    if (code < 0xc0 || code > 0xcf || other) return false;
    const auto frame = bytesAt<5>(file, segment.offset);
    size = {bigEndian16(&frame[3]), bigEndian16(&frame[1])};
    return true;
  });
  return size;
}

/// Photos of other formats, which are named in the message: phones and web pages make them.
void refuseOtherFormats(const InputFile& file) {
  if (file.size() < 12) return;
  const auto head = bytesAt<12>(file, 0);
  const auto holds = [&head](std::size_t offset, const char* text) {
    return std::memcmp(&head[offset], text, std::strlen(text)) == 0;
  };
  const char* name = nullptr;
  if (holds(4, "ftyp")) name = holds(8, "avif") ? "an AVIF" : "a HEIC (HEIF)";
  if (holds(0, "RIFF") && holds(8, "WEBP")) name = "a WebP";
  if (holds(0, "II*") || holds(0, "MM")) name = "a TIFF or raw";
  if (name == nullptr) return;
  throw std::runtime_error(std::string(name) +
                           " image: convert it to JPEG or PNG, keeping its size (a phone can be "
                           "set to take JPEG)");
}

}  // namespace

ImageSize readImageSize(const InputFile& file) {
  if (file.size() == 0) throw std::runtime_error("the file is empty");
  refuseOtherFormats(file);
  const auto start = bytesAt<2>(file, 0);
  const bool is_jpeg = start[0] == 0xff && start[1] == 0xd8;
  const ImageSize size = is_jpeg ? jpegSize(file) : pngSize(file);
  if (size.pixels() == 0) failDamaged();
  return size;
}

}  // namespace nerf_pose_refiner
