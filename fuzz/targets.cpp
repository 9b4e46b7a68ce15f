// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "targets.h"

#include <sys/mman.h>
#include <unistd.h>

#include <algorithm>
#include <stdexcept>
#include <string>

#include "dataset/bop_scene.h"
#include "dataset/colmap_binary.h"
#include "dataset/colmap_text.h"
#include "dataset/polycam.h"
#include "dataset/record3d.h"
#include "dataset/transforms_json.h"
#include "field/model_file.h"
#include "field/object_metadata.h"
#include "image/image_size.h"
#include "image/orientation.h"

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

void fuzzBopScene(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  const std::size_t first = std::min(text.find('\0'), size);
  const std::size_t second = std::min(text.find('\0', first + 1), size);
  BopSceneFiles files;
  files.name = "scene";
  files.camera = text.substr(0, first);
  if (first < size) files.gt = text.substr(first + 1, second - first - 1);
  if (second < size) files.gt_info = text.substr(second + 1);
  readOrRefuse([&] { readBopScene(files); });
}

void fuzzColmapBinary(const std::uint8_t* data, std::size_t size) {
  const MemoryFile memory(data, size);
  const InputFile file(memory.path());
  readOrRefuse([&] { readColmapCamerasBinary(file); });
  readOrRefuse([&] { readColmapImagesBinary(file, {}); });
  readOrRefuse([&] { readColmapPointsBinary(file, {}); });
}

void fuzzColmapText(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  readOrRefuse([&] { readColmapCamerasText(text); });
  readOrRefuse([&] { readColmapImagesText(text, {}); });
  readOrRefuse([&] { readColmapPointsText(text, {}); });
}

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

void fuzzPhoneScan(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  readOrRefuse([&] { readPolycamCamera(text, "camera"); });
  readOrRefuse([&] { readRecord3dMetadata(text, "metadata", {}); });
}

void fuzzTransformsJson(const std::uint8_t* data, std::size_t size) {
  const MemoryFile file(data, size);
  const DatasetFolder folder("/", false);
  readOrRefuse([&] { readTransformsJson(folder, file.path()); });
}

void fuzzImageSize(const std::uint8_t* data, std::size_t size) {
  const MemoryFile memory(data, size);
  const InputFile file(memory.path());
  readOrRefuse([&] { readImageSize(file); });
  readOrRefuse([&] { readExifOrientation(file); });
}

}  // namespace nerf_pose_refiner
