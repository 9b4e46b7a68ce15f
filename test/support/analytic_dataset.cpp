// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "analytic_dataset.h"

#include <cmath>
#include <memory>

#include "analytic_scene.h"
#include "image/colour.h"

namespace nerf_pose_refiner {

Dataset analyticDataset(int count, int size, double turn_rad) {
  const auto scene = makeAnalyticScene();
  const double focal = 1.9 * size, centre = 0.5 * size - 0.5;  // the object fills three quarters
  const Camera camera = {size, size, focal, focal, centre, centre};
  Dataset dataset;
  dataset.folder = "analytic scene";
  dataset.has_alpha = true;
  for (int i = 0; i < count; ++i) {
    PosedView view;
    view.name = "view " + std::to_string(i);
    view.camera = camera;
    const double height = (2.0 * i + 1) / count - 1;
    view.T_O_C = cameraAround(*scene, turn_rad + 2.399963229728653 * i, std::asin(height));
    const Observation seen = observeScene(*scene, camera, view.T_O_C);
    view.rgba = std::make_shared<Image8>(straightBytes({seen.image, seen.alpha}));
    dataset.views.push_back(view);
  }
  return dataset;
}

std::vector<TrainingView> trainingViews(const Dataset& dataset) {
  std::vector<TrainingView> views;
  for (const PosedView& view : dataset.views) views.push_back({view.rgba, view.camera, view.T_O_C});
  return views;
}

}  // namespace nerf_pose_refiner
