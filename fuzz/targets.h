// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <cstdint>

namespace nerf_pose_refiner {

/// Readers of files, fed with any bytes. They return if the bytes are read, or refused by a
/// std::runtime_error; whatever else happens is a fault.
void fuzzBopScene(const std::uint8_t* data, std::size_t size);  ///< three files, zero bytes between
void fuzzColmapBinary(const std::uint8_t* data, std::size_t size);
void fuzzColmapText(const std::uint8_t* data, std::size_t size);
void fuzzLandmarkFile(const std::uint8_t* data, std::size_t size);
void fuzzModelFile(const std::uint8_t* data, std::size_t size);
void fuzzObjectMetadata(const std::uint8_t* data, std::size_t size);
void fuzzPhoneScan(const std::uint8_t* data, std::size_t size);
void fuzzTransformsJson(const std::uint8_t* data, std::size_t size);
void fuzzImageSize(const std::uint8_t* data, std::size_t size);

}  // namespace nerf_pose_refiner
