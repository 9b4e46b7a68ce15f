// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "files/atomic_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <ctime>
#include <filesystem>
#include <stdexcept>

#include "files/file_lock.h"
#include "files/sync.h"

namespace nerf_pose_refiner {
namespace {

namespace fs = std::filesystem;

constexpr int kAttempts = 1000;  // files of other writers that may lie in the way
constexpr const char* kSuffix = ".tmp";
constexpr std::time_t kDay_s = 24 * 60 * 60;

fs::path folderOf(const std::string& path) {
  const fs::path folder = fs::path(path).parent_path();
  return folder.empty() ? fs::path(".") : folder;
}

/// Whether a file is called like the temporary ones of a target: <target>.tmp<process>_<number>.
bool isTemporaryOf(const std::string& target, const std::string& name) {
  const std::string stem = target + kSuffix;
  const auto is_digit = [](char c) { return (c >= '0' && c <= '9') || c == '_'; };
  return name.size() > stem.size() && name.compare(0, stem.size(), stem) == 0 &&
         std::all_of(name.begin() + static_cast<std::ptrdiff_t>(stem.size()), name.end(), is_digit);
}

/// Removes a temporary file that is not being written: its writer would hold the lock, for a day at
/// most.
void removeIfStale(const std::string& path) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOFOLLOW | O_CLOEXEC);
  if (descriptor < 0) return;
  struct stat status;
  if (fstat(descriptor, &status) == 0 && S_ISREG(status.st_mode)) {
    const bool old = std::time(nullptr) - status.st_mtime > kDay_s;
    if ((tryLock(descriptor) == LockResult::kLocked || old) && isStillAt(descriptor, path)) {
      unlink(path.c_str());
    }
  }
  close(descriptor);
}

void removeStaleTemporaries(const std::string& path) {
  const std::string target = fs::path(path).filename().string();
  std::error_code ignored;  // a folder that cannot be listed may be written in
  for (fs::directory_iterator file(folderOf(path), ignored), end; !ignored && file != end;
       file.increment(ignored)) {
    if (isTemporaryOf(target, file->path().filename().string())) {
      removeIfStale(file->path().string());
    }
  }
}

}  // namespace

AtomicFile::AtomicFile(const std::string& path) : path_(path) {
  removeStaleTemporaries(path);
  // Not mkstemp: its files are for nobody but their owner, whatever the umask says.
  const std::string stem = path + kSuffix + std::to_string(getpid()) + "_";
  for (int i = 0; descriptor_ < 0 && i < kAttempts; ++i) {
    temporary_path_ = stem + std::to_string(i);
    descriptor_ = open(temporary_path_.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (descriptor_ < 0 && errno != EEXIST) break;
    // Before the lock it looks like one that was left, and another writer may remove it.
    if (descriptor_ >= 0 && (tryLock(descriptor_) == LockResult::kHeldByAnother ||
                             !isStillAt(descriptor_, temporary_path_))) {
      close(descriptor_);
      descriptor_ = -1;
    }
  }
  if (descriptor_ < 0) fail();
}

AtomicFile::~AtomicFile() {
  if (!temporary_path_.empty()) unlink(temporary_path_.c_str());
  if (descriptor_ >= 0) close(descriptor_);
}

void AtomicFile::reserve(std::uint64_t bytes) {
  if (bytes == 0) return;
  if (fallocate(descriptor_, 0, 0, static_cast<off_t>(bytes)) == 0) return;
  if (errno != EOPNOTSUPP && errno != ENOSYS) fail();
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
  if (std::rename(temporary_path_.c_str(), path_.c_str()) != 0) fail();
  temporary_path_.clear();
  close(descriptor_);  // and the lock ends; all that can go wrong with the content did so before
  descriptor_ = -1;
  syncFolder(folderOf(path_).string());
}

void AtomicFile::fail() const {
  const int reason = errno;
  throw std::runtime_error("cannot write '" + path_ + "': " + std::strerror(reason));
}

void requireWritable(const std::string& path, std::uint64_t bytes) {
  AtomicFile(path).reserve(bytes);
}

}  // namespace nerf_pose_refiner
