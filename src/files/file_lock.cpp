// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "files/file_lock.h"

#include <fcntl.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <filesystem>
#include <stdexcept>

namespace nerf_pose_refiner {

LockResult tryLock(int descriptor) {
  if (flock(descriptor, LOCK_EX | LOCK_NB) == 0) return LockResult::kLocked;
  return errno == EWOULDBLOCK ? LockResult::kHeldByAnother : LockResult::kUnsupported;
}

bool isStillAt(int descriptor, const std::string& path) {
  struct stat open_one, there;
  return fstat(descriptor, &open_one) == 0 && lstat(path.c_str(), &there) == 0 &&
         open_one.st_dev == there.st_dev && open_one.st_ino == there.st_ino;
}

FolderLock::FolderLock(const std::string& folder) {
  // The one before may move the folder away, or remove it, between the opening and the lock.
  while (descriptor_ < 0) {
    std::error_code error;
    std::filesystem::create_directories(folder, error);
    if (error) throw std::runtime_error("cannot make '" + folder + "': " + error.message());
    descriptor_ = open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_NOFOLLOW | O_CLOEXEC);
    if (descriptor_ < 0 && errno == ENOENT) continue;
    if (descriptor_ < 0) {
      throw std::runtime_error("cannot open '" + folder + "': " + std::strerror(errno));
    }
    const LockResult result = tryLock(descriptor_);
    if (result == LockResult::kHeldByAnother) {
      close(descriptor_);
      throw std::runtime_error("'" + folder + "' is being written by somebody else");
    }
    if (isStillAt(descriptor_, folder)) return;
    close(descriptor_);
    descriptor_ = -1;
  }
}

FolderLock::~FolderLock() { close(descriptor_); }

}  // namespace nerf_pose_refiner
