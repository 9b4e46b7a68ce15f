// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/loaded_field.h"

namespace nerf_pose_refiner {

std::vector<Rendering> LoadedField::renderAll(const Camera& camera,
                                              const std::vector<Pose>& poses_T_O_C,
                                              const RenderOptions& options,
                                              const CancellationToken& cancellation) const {
  std::vector<Rendering> renderings;
  for (const Pose& T_O_C : poses_T_O_C) {
    renderings.push_back(render({camera, T_O_C}, options, cancellation));
  }
  return renderings;
}

}  // namespace nerf_pose_refiner
