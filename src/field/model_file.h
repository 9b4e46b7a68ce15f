// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>

#include "field/field.h"

namespace nerf_pose_refiner {

/// Writes a model in the safetensors layout: 8 bytes header length (little endian), a JSON header,
/// raw tensors. Goes to a temporary file in the same folder, is synced and renamed: a reader sees
/// the old file or the whole new one.
/// @throws std::runtime_error naming the path and the system's reason (a full disk, say).
void saveModel(const Field& field, const std::string& path);

/// Makes sure that a model of this shape can be saved there, before minutes are spent on learning
/// it: the folder takes files, and the disk has space.
/// @throws std::runtime_error naming the path and the system's reason.
void requireModelWritable(const FieldConfig& config, const std::string& path);

/// Reads and checks a model: layout, sizes, checksum, finite numbers.
/// @throws std::runtime_error naming the path and what is wrong with it.
Field loadModel(const std::string& path);

/// Reads what a model says of its object, and not its numbers: quick, and their damage goes unseen.
/// @throws std::runtime_error as loadModel.
FieldMetadata readModelMetadata(const std::string& path);

}  // namespace nerf_pose_refiner
