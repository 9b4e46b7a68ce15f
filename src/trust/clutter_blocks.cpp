// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/clutter_blocks.h"

#include <algorithm>

#include "math/random.h"

namespace nerf_pose_refiner {

Image clutterBlocks(const Camera& camera, std::uint64_t index) {
  constexpr std::uint64_t kSeed = 1, kStream = 0;
  Image image(camera.width, camera.height, 3);
  const int side = std::max(2, std::min(camera.width, camera.height) / 10);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      const std::uint64_t block = static_cast<std::uint64_t>(y / side) * 4096 + x / side;
      for (int c = 0; c < 3; ++c) {
        image.at(x, y, c) = randomUniform(kSeed + index, kStream, 3 * block + c);
      }
    }
  }
  return image;
}

}  // namespace nerf_pose_refiner
