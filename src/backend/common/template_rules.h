// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <vector>

#include "backend/template_matcher.h"
#include "math/template_score.h"
#include "nerf_pose_refiner/camera.h"

namespace nerf_pose_refiner {

/// A camera whose focal lengths are equal, and how large objects are in its images.
struct TemplateScale {
  Camera camera;         ///< of the image, reduced
  double object_px = 0;  ///< that the object's diameter spans where it is; gives its distance

  /// Of the object's centre [diameters].
  double distance() const { return camera.fx / object_px; }
};

/// The scale of a camera's images, reduced, at which an object spans `object_px` or, where that
/// would enlarge them, fewer pixels. @param distance of its centre [diameters].
TemplateScale templateScale(const Camera& camera, double distance, double object_px);

/// How far features may be from the object's centre, a multiple of the stride [px].
int templateMargin(const TemplateScale& scale, int stride);

/// The same place in the same image, resized.
Eigen::Vector2d movedTo(const Camera& to, const Camera& from, const Eigen::Vector2d& pixel);

/// Images at scales of templates: of a camera, one image for all distances at which it is the same.
struct TemplateLevels {
  std::vector<TemplateScale> scales;  ///< of each distance
  std::vector<int> images;            ///< of each distance, the number of its image
  std::vector<Camera> cameras;        ///< of each image
  std::vector<int> margins;           ///< of each image [px]
};

/// @param object_px that an object spans. @param stride of positions [px].
TemplateLevels templateLevels(const Camera& camera, const std::vector<double>& distances,
                              double object_px, int stride);

/// Where a template matches an image that is scanned.
struct TemplateHit {
  int score = 0;  ///< sum of responses @see TemplateKernels
  int view = 0, rotation = 0;
  int column = 0, row = 0;  ///< of the position
};

/// Of the hits of one level those that are fitted, best first.
void keepBestHits(const TemplateMatchSettings& settings, std::vector<TemplateHit>* hits);

/// @throws std::invalid_argument for an image that has not its camera's size, or no RGB.
void requireTemplateImage(const Image& image, const Camera& camera);

/// @throws std::invalid_argument for a bank that shows nothing, or views whose numbers of features
/// differ or are no multiple of TemplateView::kRun.
void requireTemplates(const TemplateBank& bank);

/// The pose of a hit of a level, its place in the image that was scanned.
TemplatePose poseOf(const TemplateHit& hit, const TemplateMatchSettings& settings,
                    const TemplateScale& scale, int level);

/// Of a view's rotation in the image.
double rotationOf(const TemplateMatchSettings& settings, int rotation);

/// Look-ups that a scan takes. @param camera of the image.
std::uint64_t scanLookups(const TemplateBank& bank, const TemplateMatchSettings& settings,
                          const Camera& camera);

/// A view that sees the object from beside another.
struct ViewBeside {
  int view;
  /// From the other's rotation in the image to the one that leaves as little as may be of the turn
  /// between both.
  double turn_rad;
};

/// For each view those that see the object from nearest beside it.
std::vector<std::vector<ViewBeside>> viewsBeside(const TemplateBank& bank);

/// A pose moved by a step.
TemplatePose moved(const TemplatePose& pose, const TemplateStep& step,
                   const TemplateMatchSettings& settings);

}  // namespace nerf_pose_refiner
