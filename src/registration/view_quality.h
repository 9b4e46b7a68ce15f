// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/backend.h"
#include "backend/loaded_field.h"
#include "dataset/dataset.h"
#include "field/field.h"

namespace nerf_pose_refiner {

/// Whether a view shows how good a model is: it shows the object, or the box that holds it.
bool isTelling(const PosedView& view, const Box& box);

/// Mean PSNR [dB] over views, rendered on black against the views composited on black. Of a view
/// without transparency only the pixels count whose rays meet the field's box: what lies behind
/// the others is not of the object.
/// @throws std::invalid_argument for no views, Cancelled.
double meanPsnr(const LoadedField& field, const std::vector<PosedView>& views,
                const CancellationToken& cancellation);

/// Writes into a field's metadata how well it shows held-out views at their poses.
void measureQuality(Backend* backend, const std::vector<PosedView>& held_out,
                    const CancellationToken& cancellation, Field* field);

}  // namespace nerf_pose_refiner
