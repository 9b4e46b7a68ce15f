// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/cpu/alignment_system.h"

namespace nerf_pose_refiner {

/// Colours relative to what is around them: localContrast with mean and deviation taken over those
/// pixels of a Gaussian window that have weight, per channel.
///
/// What is left does not change with the strength and tint of the light as long as that changes
/// slowly over the image: a face of the object that is turned to the lamp compares as well as one
/// in the shade (local normalised correlation).
///
/// Of `image` only the colours are replaced.
void takeContrast(const std::vector<float>& window, Image* image);

/// What is seen of the observation beside the object: (1 - opacity) * observed RGB, and the weight
/// of `rendered`, in their channels.
/// @param observed [h][w][3]. @param rendered [h][w][kImageChannels], neither of them blurred.
Image seenBehind(const Image& observed, const Image& rendered);

/// `takeContrast` for a rendering before an unknown background, of which the observation shows what
/// the object leaves free: at the true pose both are one image, up to the rim. The contrasts of
/// the whole, times the object's opacity, replace the colours of `rendered`.
/// @param behind `seenBehind`, blurred like `rendered`.
void takeContrastBefore(const Image& behind, const GainBias<float>& gain_bias,
                        const std::vector<float>& window, Image* rendered);

}  // namespace nerf_pose_refiner
