// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "files/sync.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace nerf_pose_refiner {
namespace {

bool sync(const std::string& path, int flags) {
  const int descriptor = open(path.c_str(), O_RDONLY | O_CLOEXEC | flags);
  if (descriptor < 0) return false;
  const bool done = fsync(descriptor) == 0;
  const int reason = errno;
  close(descriptor);
  errno = reason;
  return done;
}

}  // namespace

void syncFile(const std::string& path) {
  if (sync(path, O_NONBLOCK)) return;
  throw std::runtime_error("cannot write '" + path + "': " + std::strerror(errno));
}

void syncFolder(const std::string& path) { sync(path.empty() ? "." : path, O_DIRECTORY); }

}  // namespace nerf_pose_refiner
