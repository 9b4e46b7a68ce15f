// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "nerf_pose_refiner/image.h"
#include "views/keyframe.h"

namespace nerf_pose_refiner {

/// Channels of the images from which levels are made: premultiplied colour, alpha, and alpha times
/// the point relative to the object's centre.
constexpr int kKeyframeChannels = 7;
constexpr int kKeyframeAlpha = 3;
constexpr int kKeyframePoint = 4;

/// The images of a keyframe's levels, finest first, [h][w][kKeyframeChannels]: the part of the
/// window that shows the object.
using KeyframePyramid = std::vector<Image>;

/// The pyramids of what was rendered with the same settings. @param threads share the rows.
std::vector<KeyframePyramid> pyramidsOf(const std::vector<RenderedWindow>& windows,
                                        const FieldMetadata& object,
                                        const KeyframeSettings& settings, int threads);

}  // namespace nerf_pose_refiner
