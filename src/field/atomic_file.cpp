// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "field/atomic_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

constexpr int kAttempts = 1000;  // files of crashed processes that may lie in the way

/// Makes a renaming last. Its failure is no failure of the file, and some file systems cannot.
void syncFolderOf(const std::string& path) {
  const std::string folder = std::filesystem::path(path).parent_path().string();
  const int descriptor = open(folder.empty() ? "." : folder.c_str(), O_RDONLY | O_CLOEXEC);
  if (descriptor < 0) return;
  fsync(descriptor);
  close(descriptor);
}

}  // namespace

AtomicFile::AtomicFile(const std::string& path) : path_(path) {
  // Not mkstemp: its files are for nobody but their owner, whatever the umask says.
  const std::string stem = path + ".tmp" + std::to_string(getpid()) + "_";
  for (int i = 0; descriptor_ < 0 && i < kAttempts; ++i) {
    temporary_path_ = stem + std::to_string(i);
    descriptor_ = open(temporary_path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor_ < 0 && errno != EEXIST) break;
  }
  if (descriptor_ < 0) fail();
}

AtomicFile::~AtomicFile() {
  if (descriptor_ >= 0) close(descriptor_);
  if (!temporary_path_.empty()) unlink(temporary_path_.c_str());
}

void AtomicFile::write(const void* data, std::size_t bytes) {
  const char* next = static_cast<const char*>(data);
  while (bytes > 0) {
    const ssize_t written = ::write(descriptor_, next, bytes);
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) fail();
    next += written;
    bytes -= static_cast<std::size_t>(written);
  }
}

void AtomicFile::commit() {
  if (fsync(descriptor_) != 0) fail();
  const int closed = close(descriptor_);
  descriptor_ = -1;
  if (closed != 0) fail();
  if (std::rename(temporary_path_.c_str(), path_.c_str()) != 0) fail();
  temporary_path_.clear();
  syncFolderOf(path_);
}

void AtomicFile::fail() const {
  const int reason = errno;
  throw std::runtime_error("cannot write '" + path_ + "': " + std::strerror(reason));
}

}  // namespace nerf_pose_refiner
