// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "alignment_system.h"

namespace nerf_pose_refiner {

/// Colours relative to what is around them: kContrastUnit times (colour - mean) / deviation, mean
/// and deviation taken over a Gaussian window, per channel.
///
/// What is left does not change with the strength and tint of the light as long as that changes
/// slowly over the picture: a face of the object that is turned to the lamp compares as well as one
/// in the shade (local normalised correlation).
///
/// Of `picture` only the colours are replaced.
void takeContrast(const std::vector<float>& window, Image* picture);

/// The same for a rendering before an unknown background: the window sees the object in the
/// observation's light and, around it, the observation itself. Colours stay premultiplied.
/// @param observed picture of the same size, as the camera saw it (not its contrast).
void takeContrastBefore(const Image& observed, const GainBias<float>& light,
                        const std::vector<float>& window, Image* rendered);

}  // namespace nerf_pose_refiner
