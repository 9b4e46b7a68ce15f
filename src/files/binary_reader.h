// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <cstring>
#include <string>
#include <type_traits>
#include <vector>

#include "files/input_file.h"

namespace nerf_pose_refiner {

/// Reads little-endian numbers one after the other from a file that may hold anything. Errors are
/// std::runtime_error with the reason alone, as InputFile's.
class BinaryReader {
 public:
  /// @param file must outlive the reader.
  explicit BinaryReader(const InputFile& file) : file_(file) {}

  /// The next number.
  template <typename T>
  T read() {
    static_assert(std::is_arithmetic_v<T>);
    T value;
    std::memcpy(&value, next(sizeof value), sizeof value);
    return value;
  }

  /// The next 64-bit count, of things that take so many bytes each, at least.
  /// @throws also if what is left of the file cannot hold them.
  std::uint64_t readCount(std::uint64_t min_bytes_each);

  /// Text that ends with a zero byte. @throws also if it has more than `max_length` characters.
  std::string readText(std::size_t max_length);

  void skip(std::uint64_t bytes);

  std::uint64_t remaining() const { return file_.size() - offset_; }  ///< [bytes]

 private:
  const char* next(std::size_t bytes);

  const InputFile& file_;
  std::uint64_t offset_ = 0;         // of what is read next
  std::vector<char> buffer_;         // a part of the file
  std::uint64_t buffer_offset_ = 0;  // where that part begins
};

}  // namespace nerf_pose_refiner
