// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "dataset/colmap_binary.h"

#include <stdexcept>

#include "files/binary_reader.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::size_t kMaxNameLength = 4096;  // of a path
constexpr std::uint64_t kCameraBytes = 4 + 4 + 8 + 8 + 3 * 8;
constexpr std::uint64_t kImageBytes = 4 + 7 * 8 + 4 + 1 + 8;
constexpr std::uint64_t kKeypointBytes = 8 + 8 + 8;
constexpr std::uint64_t kPointBytes = 8 + 3 * 8 + 3 + 8 + 8;
constexpr std::uint64_t kTrackBytes = 4 + 4;

void requireSize(const InputFile& file, const DatasetLimits& limits) {
  if (file.size() > limits.model_bytes) {
    throw std::runtime_error("it has " + std::to_string(file.size()) + " bytes, at most " +
                             std::to_string(limits.model_bytes) + " are read");
  }
}

void requireAtMost(std::uint64_t limit, std::uint64_t count, const char* what) {
  if (count > limit) {
    throw std::runtime_error("it holds " + std::to_string(count) + " " + what + ", at most " +
                             std::to_string(limit) + " are read");
  }
}

void requireEnd(const BinaryReader& reader) {
  if (reader.remaining() > 0) {
    throw std::runtime_error("it goes on behind its last entry: not a file of COLMAP");
  }
}

std::vector<double> readNumbers(BinaryReader* reader, std::size_t count) {
  std::vector<double> numbers(count);
  for (double& number : numbers) number = reader->read<double>();
  return numbers;
}

}  // namespace

ColmapCameras readColmapCamerasBinary(const InputFile& file) {
  BinaryReader reader(file);
  ColmapCameras cameras;
  const std::uint64_t count = reader.readCount(kCameraBytes);
  for (std::uint64_t i = 0; i < count; ++i) {
    const auto id = reader.read<std::uint32_t>();
    const ColmapLens& lens = colmapLens(reader.read<std::int32_t>());
    const auto width = static_cast<double>(reader.read<std::uint64_t>());
    const auto height = static_cast<double>(reader.read<std::uint64_t>());
    const std::vector<double> parameters = readNumbers(&reader, lens.parameters());
    cameras[id] = colmapCamera(lens, width, height, parameters);
  }
  requireEnd(reader);
  return cameras;
}

std::uint64_t countColmapImagesBinary(const InputFile& file) {
  return BinaryReader(file).readCount(kImageBytes);
}

std::vector<ColmapImage> readColmapImagesBinary(const InputFile& file,
                                                const DatasetLimits& limits) {
  requireSize(file, limits);
  BinaryReader reader(file);
  std::vector<ColmapImage> images;
  const std::uint64_t count = reader.readCount(kImageBytes);
  requireAtMost(limits.frames, count, "photos");
  for (std::uint64_t i = 0; i < count; ++i) {
    ColmapImage image;
    reader.skip(4);  // the photo's id
    image.T_C_O = colmapPose(readNumbers(&reader, 7));
    image.camera = reader.read<std::uint32_t>();
    image.name = reader.readText(kMaxNameLength);
    reader.skip(kKeypointBytes * reader.readCount(kKeypointBytes));
    images.push_back(image);
  }
  requireEnd(reader);
  return images;
}

std::vector<ScenePoint> readColmapPointsBinary(const InputFile& file, const DatasetLimits& limits) {
  requireSize(file, limits);
  BinaryReader reader(file);
  std::vector<ScenePoint> points;
  const std::uint64_t count = reader.readCount(kPointBytes);
  requireAtMost(limits.points, count, "points");
  points.reserve(count);
  for (std::uint64_t i = 0; i < count; ++i) {
    ScenePoint point;
    reader.skip(8);  // the point's id
    for (int axis = 0; axis < 3; ++axis) point.position_O[axis] = reader.read<double>();
    for (std::uint8_t& value : point.rgb) value = reader.read<std::uint8_t>();
    point.error_px = reader.read<double>();
    const std::uint64_t photos = reader.readCount(kTrackBytes);
    point.photos = static_cast<std::uint32_t>(photos);
    reader.skip(kTrackBytes * photos);
    checkColmapPoint(point);
    points.push_back(point);
  }
  requireEnd(reader);
  return points;
}

}  // namespace nerf_pose_refiner
