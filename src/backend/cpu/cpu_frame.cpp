// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_frame.h"

namespace nerf_pose_refiner {

std::shared_ptr<CpuFrames> makeCpuFrames() {
  constexpr double kWorkToBegin = 0;  // all is in the pixels
  return std::make_shared<CpuFrames>(kWorkToBegin);
}

void CpuFrame::look(const Observation& observation, const FrameWindow& window) {
  const FrameLevels levels(observation, window);
  levels_ = FrameLevels();  // if this fails, there is nothing to see
  reader_.look(observation, levels, [&](const FramePart& part, FramePyramid* pyramid) {
    pyramid->make(observation, part);
  });
  levels_ = levels;
}

std::optional<KernelImage> CpuFrame::level(int level) const {
  if (!levels_.has(level)) return std::nullopt;
  const Image& image = reader_.frame().level(level);
  const PixelWindow own = reader_.part().pixelsOf(levels_, level);
  return KernelImage{image.pixel(own.x, own.y), own.width, own.height, image.width,
                     levels_.intrinsics(level)};
}

}  // namespace nerf_pose_refiner
