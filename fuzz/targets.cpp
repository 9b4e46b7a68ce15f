// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "targets.h"

#include <sys/mman.h>
#include <unistd.h>

#include <stdexcept>
#include <string>

#include "dataset/transforms_json.h"
#include "field/model_file.h"
#include "field/object_metadata.h"
#include "image/image_size.h"

namespace nerf_pose_refiner {
namespace {

/// A file that is nowhere but in memory, and has a path.
class MemoryFile {
 public:
  MemoryFile(const std::uint8_t* data, std::size_t size)
      : descriptor_(memfd_create("fuzz", MFD_CLOEXEC)) {
    if (descriptor_ < 0 || write(descriptor_, data, size) != static_cast<ssize_t>(size)) {
      throw std::logic_error("no memory for a file");
    }
  }
  ~MemoryFile() { close(descriptor_); }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;

  std::string path() const { return "/proc/self/fd/" + std::to_string(descriptor_); }

 private:
  int descriptor_;
};

/// Reads a file. Exceptions other than the documented ones pass through.
template <typename Reader>
void readOrRefuse(const Reader& read) {
  try {
    read();
  } catch (const std::runtime_error&) {
  }
}

}  // namespace

void fuzzModelFile(const std::uint8_t* data, std::size_t size) {
  const MemoryFile file(data, size);
  readOrRefuse([&] { readModelMetadata(file.path()); });
  readOrRefuse([&] { loadModel(file.path()); });
}

void fuzzObjectMetadata(const std::uint8_t* data, std::size_t size) {
  const MemoryFile file(data, size);
  readOrRefuse([&] {
    FieldMetadata object;
    apply(readObjectMetadata(file.path()), &object);
  });
}

void fuzzTransformsJson(const std::uint8_t* data, std::size_t size) {
  const MemoryFile file(data, size);
  readOrRefuse([&] { readTransformsJson(file.path()); });
}

void fuzzImageSize(const std::uint8_t* data, std::size_t size) {
  const MemoryFile file(data, size);
  readOrRefuse([&] { readImageSize(InputFile(file.path())); });
}

}  // namespace nerf_pose_refiner
