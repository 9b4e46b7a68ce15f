// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "backend/backend.h"
#include "dataset/dataset.h"
#include "field/field.h"
#include "nerf_pose_refiner/cancellation_token.h"

namespace nerf_pose_refiner {

/// Makes what detection knows an object by when it is learned: its photos, which show more than the
/// field, are at hand then. Where the files cannot be written, detection makes it of the field.
/// @param landmark_path templates are beside it. @throws Cancelled.
void learnDetection(Backend* backend, const std::shared_ptr<const Field>& field,
                    const Dataset& photos, const std::string& landmark_path,
                    const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
