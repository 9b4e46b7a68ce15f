// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace nerf_pose_refiner {

/// A regular file that is open for reading. Whatever else bears its name (a pipe, a device, a
/// folder) is refused, and never waited for.
///
/// Errors are std::runtime_error and give the reason alone: callers know what the file is to them,
/// and name it.
class InputFile {
 public:
  explicit InputFile(const std::string& path);
  ~InputFile();
  InputFile(const InputFile&) = delete;
  InputFile& operator=(const InputFile&) = delete;

  std::uint64_t size() const { return size_; }  ///< when it was opened [bytes]

  /// Reads bytes that begin at an offset. @throws also if the file ends before.
  void read(std::uint64_t offset, void* data, std::size_t bytes) const;

 private:
  int descriptor_;
  std::uint64_t size_ = 0;
};

/// The whole content of a file.
/// @param max_bytes of it; more is an error.
std::string readWhole(const InputFile& file, std::uint64_t max_bytes);

}  // namespace nerf_pose_refiner
