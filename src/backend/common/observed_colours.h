// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "nerf_pose_refiner/observation.h"

namespace nerf_pose_refiner {

/// The colours of an observation, [h][w][3], whichever form it has them in.
Image observedColours(const Observation& observation);

/// A part of them, at the cost of this part. @param window inside of the image.
Image observedColours(const Observation& observation, const PixelWindow& window);

/// A part of them, reduced: averages over the area of each new pixel.
/// @param target a camera that sees nothing beyond the window. @see resample
Image reducedColours(const Observation& observation, const PixelWindow& window,
                     const Camera& target);

/// What an overlay is drawn over, [h][w][3]: its colours, or of depth alone a grey image, near
/// things bright.
Image overlayGround(const Observation& observation);

}  // namespace nerf_pose_refiner
