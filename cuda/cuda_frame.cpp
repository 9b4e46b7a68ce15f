// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_frame.h"

#include <stdexcept>
#include <string>

namespace nerf_pose_refiner {

std::shared_ptr<CudaFrames> makeCudaFrames() {
  constexpr double kWorkToBegin = 150000;  // launches and copies take as long as so many pixels
  return std::make_shared<CudaFrames>(kWorkToBegin);
}

void CudaFrame::look(const Observation& observation, const FrameWindow& window,
                     cudaStream_t stream) {
  const FrameLevels levels(observation, window);
  if (levels.count() > kMaxFrameLevels) {
    throw std::invalid_argument("alignment to keyframes takes no more than " +
                                std::to_string(kMaxFrameLevels) + " levels of an image");
  }
  levels_ = FrameLevels();  // if this fails, there is nothing to see
  reader_.look(observation, levels, [&](const FramePart& part, CudaFramePyramid* pyramid) {
    pyramid->make(observation, part, stream);
  });
  reader_.frame().awaitIn(stream);
  levels_ = levels;
}

std::vector<CudaFrameLevel> CudaFrame::all() const {
  std::vector<CudaFrameLevel> all;
  for (int i = 0; i < levels_.count(); ++i) {
    const int level = levels_.finest() + i;
    const CudaLevelPixels from = reader_.frame().level(level);
    const PixelWindow own = reader_.part().pixelsOf(levels_, level);
    all.push_back({from.pixels + static_cast<std::size_t>(own.y) * from.width + own.x, own.width,
                   own.height, from.width, levels_.intrinsics(level)});
  }
  return all;
}

}  // namespace nerf_pose_refiner
