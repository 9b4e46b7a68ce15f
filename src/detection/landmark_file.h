// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "detection/landmarks.h"

namespace nerf_pose_refiner {

struct Field;

/// Tells apart fields and settings whose landmarks differ.
std::uint64_t landmarkKey(const Field& field, const LandmarkSettings& settings);

/// <name>.landmarks of <name>.safetensors.
std::string landmarkPathOf(const std::string& model_path);

/// Writes landmarks whole or not at all, with descriptors of a byte a number.
/// @param key of what they were made from. @throws std::runtime_error naming the path and the
/// system's reason.
void saveLandmarks(const Landmarks& landmarks, std::uint64_t key, const std::string& path);

/// Landmarks as a file gives them back, their numbers rounded.
Landmarks asStored(const Landmarks& landmarks);

/// Reads landmarks; nothing if there is no such file, if they were made from something else, or if
/// the file is damaged: they can be made again.
std::optional<Landmarks> loadLandmarks(const std::string& path, std::uint64_t key);

}  // namespace nerf_pose_refiner
