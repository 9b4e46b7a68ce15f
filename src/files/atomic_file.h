// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>

namespace nerf_pose_refiner {

/// A file that appears whole or not at all: written beside its place, synced, and renamed.
///
/// Without a `commit` the destructor removes what was written, and what was there stays. What
/// killed processes left of the same file is removed by the constructor.
class AtomicFile {
 public:
  /// @throws std::runtime_error naming the path and the system's reason, as do all methods.
  explicit AtomicFile(const std::string& path);
  ~AtomicFile();
  AtomicFile(const AtomicFile&) = delete;
  AtomicFile& operator=(const AtomicFile&) = delete;

  /// Reserves space for so many bytes, where the file system can promise it; the file has them
  /// then.
  void reserve(std::uint64_t bytes);
  void write(const void* data, std::size_t bytes);
  void commit();

 private:
  [[noreturn]] void fail() const;

  std::string path_;
  std::string temporary_path_;
  int descriptor_ = -1;
};

/// Makes sure that a file of this size can be written there, before minutes are spent on what it
/// will hold. What is there stays.
/// @throws std::runtime_error naming the path and the system's reason.
void requireWritable(const std::string& path, std::uint64_t bytes);

}  // namespace nerf_pose_refiner
