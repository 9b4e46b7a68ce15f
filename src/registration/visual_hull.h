// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dataset/dataset.h"
#include "field/field.h"
#include "nerf_pose_refiner/cancellation_token.h"

namespace nerf_pose_refiner {

/// Where an object can be, judging by its silhouettes.
struct Hull {
  Box box;               ///< tight, with a margin [model units]
  OccupancyGrid region;  ///< of the box's cube, dilated by one cell; no resolution: the whole box
};

/// Box and region of the object (Laurentini 1994: the visual hull, on a grid of cells).
///
/// A cell stays if every view that holds it shows some of the object there, and a quarter of the
/// views hold it. An image without anything opaque on its border holds the whole object, so all
/// of space; any other holds what lies inside. Without alpha the dataset's own box is taken, whole.
/// @param resolution of the region's grid, a multiple of 8. @param threads 0: all cores.
/// @param slack by how much silhouettes may be out of place, a share of their widths and heights:
/// each is taken as so much wider on all sides. For poses that are not exact.
/// @throws std::runtime_error if there is neither alpha nor a box, or if the silhouettes have no
/// common volume (poses that do not belong to the images, say). Cancelled.
Hull visualHull(const Dataset& dataset, int resolution, int threads,
                const CancellationToken& cancellation, double slack = 0);

}  // namespace nerf_pose_refiner
