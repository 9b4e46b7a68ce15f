// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "image/image_size.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// Larger images are not read: they would take 4 bytes a pixel and more.
constexpr std::uint64_t kMaxImagePixels = std::uint64_t{1} << 26;

/// Size of a PNG or a JPEG: its header is read, and nothing is decoded.
/// @throws std::runtime_error naming the path and what is wrong with it.
ImageSize imageSizeOf(const std::string& path);

/// Reads a PNG or JPEG as RGB, or as RGBA with straight alpha if the
/// file has an alpha channel. Grey becomes RGB, 16 bits are rounded to 8. The image is not turned
/// by its EXIF orientation, for neither are the intrinsics that belong to it.
/// @param max_pixels of the image; larger ones are refused before they are decoded.
/// @throws std::runtime_error naming the path and what is wrong with it (missing, cut off, damaged,
/// too large).
Image8 readImage(const std::string& path, std::uint64_t max_pixels = kMaxImagePixels);

/// Reads a mask as [h][w][1]: 0 outside, 255 on the object, in between at its rim. A file that
/// holds only 0 and 1 is read as 0 and 255.
/// @throws std::runtime_error as readImage.
Image8 readMask(const std::string& path, std::uint64_t max_pixels = kMaxImagePixels);

/// Reads a depth image, a PNG of 16-bit grey, as [h][w][1]. What a step of its values is, the file
/// does not say (TUM, BOP and REP-118 differ); 0 means no measurement.
/// @throws std::runtime_error as readImage, and for a PNG of another type.
ImageOf<std::uint16_t> readDepthPng(const std::string& path,
                                    std::uint64_t max_pixels = kMaxImagePixels);

/// Writes an image of 1 (grey), 3 (RGB) or 4 (RGBA, straight alpha) channels as PNG.
/// @throws std::invalid_argument for another number of channels or an empty image,
/// std::runtime_error naming the path and the system's reason.
void writePng(const Image8& image, const std::string& path);

/// Writes depths, [h][w][1] in metres, as a PNG of 16-bit millimetres; 0 means none (REP-118).
/// @throws as writePng.
void writeDepthPng(const Image& depth_m, const std::string& path);

}  // namespace nerf_pose_refiner
