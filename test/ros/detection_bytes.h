// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

namespace nerf_pose_refiner {

/// The message of detections.hex as it is sent, @see test_detection_definition.py: in the image of
/// 12.0000005 s two boxes, of classes 3 and 5 and of class 5.
inline std::vector<std::uint8_t> exampleDetections() {
  const std::string path = NPR_SOURCE_DIR "/test/ros/detections.hex";
  std::ifstream file(path);
  std::string digits;
  if (!(file >> digits)) throw std::runtime_error(path + " cannot be read");
  std::vector<std::uint8_t> bytes;
  for (std::size_t i = 0; i + 1 < digits.size(); i += 2) {
    bytes.push_back(static_cast<std::uint8_t>(std::stoi(digits.substr(i, 2), nullptr, 16)));
  }
  return bytes;
}

}  // namespace nerf_pose_refiner
