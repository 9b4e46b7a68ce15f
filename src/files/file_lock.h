// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

namespace nerf_pose_refiner {

/// Outcome of an attempt to lock an open file or folder against other processes and threads that
/// ask this way (flock). The lock ends with the descriptor, so that a killed process holds none.
enum class LockResult { kLocked, kHeldByAnother, kUnsupported };
LockResult tryLock(int descriptor);

/// Whether a descriptor is of what now bears that path, and not of what bore it before.
bool isStillAt(int descriptor, const std::string& path);

/// Holds a folder for one writer. Where the file system knows no locks it holds nothing.
class FolderLock {
 public:
  /// Makes the folder, if there is none.
  /// @throws std::runtime_error naming the folder, if another holds it or it cannot be made.
  explicit FolderLock(const std::string& folder);
  ~FolderLock();
  FolderLock(const FolderLock&) = delete;
  FolderLock& operator=(const FolderLock&) = delete;

 private:
  int descriptor_ = -1;
};

}  // namespace nerf_pose_refiner
