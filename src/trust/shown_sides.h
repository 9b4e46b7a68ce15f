// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "backend/keyframe_points.h"
#include "backend/loaded_field.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/image.h"
#include "views/view_bank.h"

namespace nerf_pose_refiner {

/// A side of the object, as a keyframe and as a camera sees it. Both are of one rendering.
struct ShownSide {
  std::shared_ptr<const KeyframePoints> points;
  Image colour;  ///< of `points->camera`, premultiplied
  Image alpha;
};

/// The sides that a view bank with these settings has. @throws Cancelled.
std::vector<ShownSide> renderSides(const LoadedField& field, const ViewBankSettings& settings,
                                   const CancellationToken& cancellation);

/// A side before clutter. @param index of the clutter.
Image beforeClutter(const ShownSide& side, std::uint64_t index);

}  // namespace nerf_pose_refiner
