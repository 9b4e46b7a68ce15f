// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "runtime/detection_files.h"

#include <vector>

#include "backend/loaded_field.h"
#include "detection/detection_model.h"
#include "detection/landmark_file.h"

namespace nerf_pose_refiner {

std::string landmarkPathOf(const ModelCache& models, const std::shared_ptr<const Field>& field) {
  const std::string model = models.pathOf(field);
  return model.empty() ? model : landmarkPathOf(model);
}

void learnDetection(Backend* backend, const std::shared_ptr<const Field>& field,
                    const Dataset& photos, const std::string& landmark_path,
                    const CancellationToken& cancellation) {
  std::vector<LandmarkPhoto> views;
  for (const PosedView& view : photos.views) {
    views.push_back({view.rgba, {view.camera, view.T_O_C}});
  }
  makeDetectionModel(*backend->load(field), views,
                     DetectionModelSettings().adaptedTo(backend->info()), landmark_path,
                     cancellation);
}

void makeDetectionFiles(Backend* backend, const ModelCache& models,
                        const std::shared_ptr<const Field>& field,
                        const CancellationToken& cancellation) {
  const std::string path = landmarkPathOf(models, field);
  if (path.empty()) return;
  detectionModelFor(*backend->load(field), DetectionModelSettings().adaptedTo(backend->info()),
                    path, cancellation);
}

}  // namespace nerf_pose_refiner
