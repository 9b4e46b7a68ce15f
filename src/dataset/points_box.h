// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "dataset/dataset.h"

namespace nerf_pose_refiner {

/// Takes the bounds of the scene's points for the object's box, and says so in the notes: what
/// stands around the object is in it, too. Points far from all others, and those that few photos
/// or none agree on, do not count.
/// @param dataset with points.
void useBoxOfPoints(Dataset* dataset);

}  // namespace nerf_pose_refiner
