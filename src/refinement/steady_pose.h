// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/hypotheses.h"
#include "backend/keyframe_points.h"
#include "field/field.h"
#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// A tracked pose, or where it was expected if what covers a part of the object has dragged it
/// away: alignment then found the edges of something else, and the image shows the object clearly
/// better where it was expected. That is asked only if a covered object has moved suddenly.
/// @param found live. @param keyframe from near both poses.
Pose steadyPose(const FieldMetadata& object, const Observation& observation, const Pose& expected,
                const Hypothesis& found, const KeyframePoints& keyframe);

}  // namespace nerf_pose_refiner
