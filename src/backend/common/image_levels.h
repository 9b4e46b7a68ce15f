// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// The image at half its size: each pixel is the mean of 2 x 2; an odd last row or column is left
/// out. @param half is resized, its memory reused.
void halveImage(const Image& image, Image* half);

/// A row of it. @param upper, lower the two rows that it halves. @param width of `half` [px].
void halveRow(const float* upper, const float* lower, int width, int channels, float* half);

/// The image under the kernel (1, 2, 1) / 4 along both axes, a sigma of 0.7 pixels; at the border
/// its outermost pixels go on. @param smooth is resized, its memory reused.
void smoothImage(const Image& image, Image* smooth);

/// Its rows from `first` to before `last`. @param smooth of the image's size.
void smoothRows(const Image& image, int first, int last, Image* smooth);

}  // namespace nerf_pose_refiner
