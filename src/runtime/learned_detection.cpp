// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/learned_detection.h"

#include <vector>

#include "backend/loaded_field.h"
#include "detection/detection_model.h"

namespace nerf_pose_refiner {

void learnDetection(Backend* backend, const std::shared_ptr<const Field>& field,
                    const Dataset& photos, const std::string& landmark_path,
                    const CancellationToken& cancellation) {
  std::vector<LandmarkPhoto> views;
  for (const PosedView& view : photos.views) {
    views.push_back({view.rgba, {view.camera, view.T_O_C}});
  }
  makeDetectionModel(*backend->load(field), views, {}, landmark_path, cancellation);
}

}  // namespace nerf_pose_refiner
