// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <string>
#include <vector>

#include "dataset/colmap_model.h"
#include "files/input_file.h"

namespace nerf_pose_refiner {

/// The files cameras.bin, images.bin and points3D.bin of a COLMAP model, after COLMAP's page
/// "Output Format"; little-endian:
///
///     cameras:  u64 n; n x (u32 id, i32 model, u64 width, u64 height, f64 parameters...)
///     images:   u64 n; n x (u32 id, f64 qw qx qy qz tx ty tz, u32 camera, name and a zero byte,
///                           u64 m, m x (f64 x, f64 y, u64 point))
///     points3D: u64 n; n x (u64 id, f64 x y z, u8 r g b, f64 error, u64 m, m x (u32 image, u32
///                           index))
///
/// From version 3.12 on a model has rigs.bin and frames.bin, too. They say again, for sensors that
/// are mounted together, what images.bin says for each photo, and are not read.
///
/// All throw std::runtime_error with the reason alone.
ColmapCameras readColmapCamerasBinary(const InputFile& file);
std::vector<ColmapImage> readColmapImagesBinary(const InputFile& file, const DatasetLimits& limits);
std::vector<ScenePoint> readColmapPointsBinary(const InputFile& file, const DatasetLimits& limits);

/// How many photos have a pose, as the head of images.bin says.
std::uint64_t countColmapImagesBinary(const InputFile& file);

}  // namespace nerf_pose_refiner
