// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>

#include "dataset/dataset.h"

namespace nerf_pose_refiner {

/// Grey views without alpha; view i stands at x = i, inside of the box.
inline Dataset greyDataset(int count) {
  Dataset dataset;
  dataset.folder = "grey";
  dataset.has_box = true;
  dataset.box_min = {-1, -2, -3};
  dataset.box_max = {60, 2, 3};
  for (int i = 0; i < count; ++i) {
    PosedView view;
    auto rgba = std::make_shared<Image8>(4, 4, 4, 128);
    for (int p = 0; p < 16; ++p) rgba->values[4 * p + 3] = 255;
    view.rgba = rgba;
    view.camera = {4, 4, 5, 5, 1.5, 1.5};
    view.T_O_C.t.x() = i;
    dataset.views.push_back(view);
  }
  return dataset;
}

}  // namespace nerf_pose_refiner
