// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "targets.h"

#include <algorithm>
#include <cstring>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <string>
#include <vector>

#include "dataset/bop_scene.h"
#include "dataset/colmap_binary.h"
#include "dataset/colmap_text.h"
#include "dataset/polycam.h"
#include "dataset/record3d.h"
#include "dataset/transforms_json.h"
#include "detection/landmark_file.h"
#include "field/model_file.h"
#include "field/object_metadata.h"
#include "files/json.h"
#include "image/image_size.h"
#include "image/orientation.h"
#include "math/checksum.h"
#include "memory_file.h"

namespace nerf_pose_refiner {
namespace {

/// A model file with the checksum of its content, which no search finds by chance; empty: it has no
/// place for one.
std::string withRightChecksum(const std::uint8_t* data, std::size_t size) {
  std::uint64_t length = 0;
  if (size < sizeof length) return "";
  std::memcpy(&length, data, sizeof length);
  if (length > size - sizeof length) return "";
  const char* const text = reinterpret_cast<const char*>(data) + sizeof length;
  try {
    nlohmann::json header = parseJson(std::string(text, length));
    nlohmann::json& metadata = header.at("__metadata__");
    const std::string description = metadata.at("field");
    const std::string tensors(text + length, size - sizeof length - length);
    Checksum checksum;
    checksum.add(description.data(), description.size());
    checksum.add(tensors.data(), tensors.size());
    metadata["checksum"] = checksum.text();
    const std::string written = header.dump();
    length = written.size();
    return std::string(reinterpret_cast<const char*>(&length), sizeof length) + written + tensors;
  } catch (const std::exception&) {  // no such header
    return "";
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

void fuzzLandmarkFile(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kKey = 8, kChecksum = 16, kContent = 24;  // where they begin
  std::vector<std::uint8_t> bytes(data, data + size);
  std::uint64_t key = 0;
  if (size >= kContent) std::memcpy(&key, bytes.data() + kKey, sizeof key);
  loadLandmarks(MemoryFile(bytes.data(), size).path(), key);
  if (size < kContent) return;
  Checksum checksum;  // the right one, which no search finds by chance
  checksum.add(bytes.data() + kContent, size - kContent);
  const std::uint64_t value = checksum.value();
  std::memcpy(bytes.data() + kChecksum, &value, sizeof value);
  loadLandmarks(MemoryFile(bytes.data(), size).path(), key);
}

void fuzzModelFile(const std::uint8_t* data, std::size_t size) {
  const MemoryFile file(data, size);
  readOrRefuse([&] { readModelMetadata(file.path()); });
  readOrRefuse([&] { loadModel(file.path()); });
  const std::string right = withRightChecksum(data, size);
  if (!right.empty())
    readOrRefuse([&] { loadModel(MemoryFile(right.data(), right.size()).path()); });
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
