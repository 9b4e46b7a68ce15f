// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "files/input_file.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// How a photo is to be turned before it is looked at, as its EXIF data say: 1 (as it is) to 8. 1
/// for a file that does not say it.
/// @throws std::runtime_error with the reason alone, as InputFile does.
int readExifOrientation(const InputFile& file);

/// Whether that exchanges width and height.
inline bool exchangesSides(int orientation) { return orientation >= 5; }

/// The photo as it is to be looked at.
Image8 upright(const Image8& image, int orientation);

}  // namespace nerf_pose_refiner
