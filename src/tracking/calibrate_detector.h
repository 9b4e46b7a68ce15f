// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "detection/object_detector.h"

namespace nerf_pose_refiner {

/// Lets a detector judge poses by what is known of its object: the scores of right and wrong poses,
/// and its look-alikes. Both are measured for models that were made before these were stored.
/// @throws Cancelled.
void calibrate(ObjectDetector* detector, Backend* backend, const LoadedField& field,
               const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
