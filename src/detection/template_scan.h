// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "detection/template_kernels.h"
#include "detection/template_placement.h"
#include "nerf_pose_refiner/cancellation_token.h"

namespace nerf_pose_refiner {

/// An image at the scale of templates, and how it responds to their edges.
struct TemplateLevel {
  TemplateScale scale;
  ResponseMemory memory;
};

/// The level at which an object spans some pixels; its image is not enlarged for that.
/// @param image [h][w][3] of `camera`. @param distance of the object's centre [diameters].
/// @param stride of positions [px].
TemplateLevel makeTemplateLevel(const Image& image, const Camera& camera,
                                const TemplateScale& wanted, int stride);

/// The scale of a camera's images, reduced, at which an object spans `object_px` or, where that
/// would enlarge them, fewer pixels. @param distance of its centre [diameters].
TemplateScale templateScale(const Camera& camera, double distance, double object_px);

/// Where a template fits an image.
struct TemplateHit {
  int score = 0;  ///< @see TemplateKernels
  int level = 0, view = 0, rotation = 0;
  Eigen::Vector2d pixel;  ///< of the object's centre, in the level's image
};

/// What is looked for in every level.
struct TemplateSet {
  const TemplateBank& bank;
  int rotations;  ///< of each view in the image, evenly over the circle

  TurnedView turned(int view, int rotation) const;
};

/// How a level is scanned.
struct ScanWork {
  int hits_per_template;  ///< at most, >= 1
  int threads;
  const TemplateKernels& kernels;
};

/// Places where an object fits an image, of each view and rotation: those of the highest scores, in
/// different parts of the image. Every second edge counts. @throws Cancelled.
std::vector<TemplateHit> scanLevel(const TemplateLevel& level, const TemplateSet& templates,
                                   const ScanWork& work, const CancellationToken& cancellation);

/// The mean response over the edges that count, 0..1. @param edges of the template.
double meanResponse(int score, int edges);

}  // namespace nerf_pose_refiner
