// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace nerf_pose_refiner {

/// Bytes of a binary file, little-endian as the machine's.
class Bytes {
 public:
  template <typename T>
  Bytes& add(T value) {
    content_.append(reinterpret_cast<const char*>(&value), sizeof value);
    return *this;
  }
  Bytes& addAll(const std::vector<double>& values) {
    for (const double value : values) add(value);
    return *this;
  }
  Bytes& addText(const std::string& text) {
    content_.append(text.c_str(), text.size() + 1);
    return *this;
  }
  const std::string& content() const { return content_; }

 private:
  std::string content_;
};

/// Files of COLMAP models as its page "Output Format" has them, written out once more for tests.
struct ColmapTestCamera {
  std::uint32_t id;
  int model;
  std::string model_name;
  std::uint64_t width, height;
  std::vector<double> parameters;
};

struct ColmapTestImage {
  std::uint32_t id;
  std::vector<double> pose;  // qw qx qy qz tx ty tz
  std::uint32_t camera;
  std::string name;
  int keypoints = 0;
};

struct ColmapTestPoint {
  std::array<double, 3> xyz;
  std::array<int, 3> rgb;
  double error;
  std::uint32_t track;
};

inline std::string camerasBinary(const std::vector<ColmapTestCamera>& cameras) {
  Bytes bytes;
  bytes.add<std::uint64_t>(cameras.size());
  for (const ColmapTestCamera& c : cameras) {
    bytes.add(c.id).add<std::int32_t>(c.model).add(c.width).add(c.height).addAll(c.parameters);
  }
  return bytes.content();
}

inline std::string imagesBinary(const std::vector<ColmapTestImage>& images) {
  Bytes bytes;
  bytes.add<std::uint64_t>(images.size());
  for (const ColmapTestImage& image : images) {
    bytes.add(image.id).addAll(image.pose).add(image.camera).addText(image.name);
    bytes.add<std::uint64_t>(static_cast<std::uint64_t>(image.keypoints));
    for (int i = 0; i < image.keypoints; ++i) bytes.add(1.5).add(2.5).add<std::int64_t>(-1);
  }
  return bytes.content();
}

inline std::string pointsBinary(const std::vector<ColmapTestPoint>& points) {
  Bytes bytes;
  bytes.add<std::uint64_t>(points.size());
  std::uint64_t id = 70;
  for (const ColmapTestPoint& p : points) {
    bytes.add(id++).add(p.xyz[0]).add(p.xyz[1]).add(p.xyz[2]);
    for (const int value : p.rgb) bytes.add(static_cast<std::uint8_t>(value));
    bytes.add(p.error).add<std::uint64_t>(p.track);
    for (std::uint32_t i = 0; i < p.track; ++i) bytes.add(i).add<std::uint32_t>(7);
  }
  return bytes.content();
}

}  // namespace nerf_pose_refiner
