// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "files/binary_reader.h"

#include <algorithm>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

constexpr std::uint64_t kBufferBytes = std::uint64_t{1} << 16;

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "numbers are copied as they are");

}  // namespace

const char* BinaryReader::next(std::size_t bytes) {
  if (bytes > remaining()) throw std::runtime_error("it ends too soon");
  const std::uint64_t buffer_end = buffer_offset_ + buffer_.size();
  if (offset_ < buffer_offset_ || offset_ + bytes > buffer_end) {
    buffer_.resize(std::min(kBufferBytes, remaining()));
    buffer_offset_ = offset_;
    file_.read(buffer_offset_, buffer_.data(), buffer_.size());
  }
  const char* data = buffer_.data() + (offset_ - buffer_offset_);
  offset_ += bytes;
  return data;
}

std::uint64_t BinaryReader::readCount(std::uint64_t min_bytes_each) {
  const auto count = read<std::uint64_t>();
  if (count > remaining() / min_bytes_each) {
    throw std::runtime_error("it ends too soon for the " + std::to_string(count) +
                             " entries that it announces");
  }
  return count;
}

std::string BinaryReader::readText(std::size_t max_length) {
  std::string text;
  while (const char c = read<char>()) {
    if (text.size() == max_length) {
      throw std::runtime_error("a name has more than " + std::to_string(max_length) +
                               " characters");
    }
    text += c;
  }
  return text;
}

void BinaryReader::skip(std::uint64_t bytes) {
  if (bytes > remaining()) throw std::runtime_error("it ends too soon");
  offset_ += bytes;
}

}  // namespace nerf_pose_refiner
