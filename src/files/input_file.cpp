// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "files/input_file.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <stdexcept>

namespace nerf_pose_refiner {

InputFile::InputFile(const std::string& path)
    : descriptor_(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_NOCTTY | O_CLOEXEC)) {
  if (descriptor_ < 0) throw std::runtime_error(std::strerror(errno));
  struct stat status;
  const bool known = fstat(descriptor_, &status) == 0;
  if (known && S_ISREG(status.st_mode)) {
    size_ = static_cast<std::uint64_t>(status.st_size);
    return;
  }
  const std::string reason = !known                    ? std::strerror(errno)
                             : S_ISDIR(status.st_mode) ? "it is a directory, no file"
                                                       : "it is no regular file";
  close(descriptor_);
  throw std::runtime_error(reason);
}

InputFile::~InputFile() { close(descriptor_); }

void InputFile::read(std::uint64_t offset, void* data, std::size_t bytes) const {
  char* next = static_cast<char*>(data);
  while (bytes > 0) {
    const ssize_t read = pread(descriptor_, next, bytes, static_cast<off_t>(offset));
    if (read < 0 && errno == EINTR) continue;
    if (read < 0) throw std::runtime_error(std::strerror(errno));
    if (read == 0) throw std::runtime_error("it ends too soon");
    next += read;
    offset += static_cast<std::uint64_t>(read);
    bytes -= static_cast<std::size_t>(read);
  }
}

std::string readWhole(const InputFile& file, std::uint64_t max_bytes) {
  if (file.size() > max_bytes) {
    throw std::runtime_error("it has " + std::to_string(file.size()) + " bytes, at most " +
                             std::to_string(max_bytes) + " are read");
  }
  std::string content(file.size(), '\0');
  file.read(0, &content[0], content.size());
  return content;
}

}  // namespace nerf_pose_refiner
