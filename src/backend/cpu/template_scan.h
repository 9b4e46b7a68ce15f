// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "backend/common/template_rules.h"
#include "backend/cpu/template_kernels.h"
#include "backend/cpu/template_responses.h"
#include "math/template_placement.h"
#include "nerf_pose_refiner/cancellation_token.h"

namespace nerf_pose_refiner {

/// An image at the scale of templates, and how it responds to their features.
struct TemplateLevel {
  TemplateScale scale;
  const ResponseMemory& memory;  ///< of an image of the scale's camera
};

/// What is looked for.
struct TemplateSet {
  const TemplateBank& bank;
  const TemplateMatchSettings& settings;
};

/// A processor's way of looking.
struct ScanWork {
  int threads;
  const TemplateKernels& kernels;
};

/// Where a template's features meet responses, part after part. @param step 2: every second
/// feature.
void placeFeatures(const TemplateView& view, const TemplatePlacement& placement, int step,
                   const ResponseOrder& order, std::vector<std::int32_t>* offsets);

/// Places where an object fits an image, of each view and rotation: those of the highest scores, in
/// different parts of the image. Every second feature counts. @throws Cancelled.
std::vector<TemplateHit> scanLevel(const TemplateLevel& level, const TemplateSet& templates,
                                   const ScanWork& work, const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
