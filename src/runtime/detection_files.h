// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <string>

#include "backend/backend.h"
#include "dataset/dataset.h"
#include "field/field.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "runtime/model_cache.h"

namespace nerf_pose_refiner {

// What detection knows an object by is kept in files beside its model. Where they cannot be
// written, or are missing, detection makes it of the field.

/// The file of a model's landmarks, beside which its templates are; empty for a model that has no
/// file.
std::string landmarkPathOf(const ModelCache& models, const std::shared_ptr<const Field>& field);

/// Makes the files of an object when it is learned: its photos, which show more than the field, are
/// at hand then. @param landmark_path empty: no file. @throws Cancelled.
void learnDetection(Backend* backend, const std::shared_ptr<const Field>& field,
                    const Dataset& photos, const std::string& landmark_path,
                    const CancellationToken& cancellation);

/// Makes the files of an object that are missing, so that no image waits for them later. Does
/// nothing for a model that has no file. @throws std::runtime_error where the backend has no memory
/// for the object, Cancelled.
void makeDetectionFiles(Backend* backend, const ModelCache& models,
                        const std::shared_ptr<const Field>& field,
                        const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
