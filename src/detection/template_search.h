// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "backend/backend.h"
#include "backend/template_matcher.h"
#include "detection/candidate.h"
#include "detection/depth_layers.h"
#include "field/field.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// How far away an object may be.
struct DistanceRange {
  double nearest, farthest;  ///< of its centre [diameters]

  /// Those at which an object's diameter spans from 1/8 to all of the longer side of a camera's
  /// images.
  static DistanceRange usual(const Camera& camera);

  /// @throws std::invalid_argument for a range that makes no sense.
  void validate() const;
};

struct TemplateSearchSettings {
  TemplateMatchSettings matching;
  int candidates = 20;        ///< that are returned, at most, times the number of distances
  double min_evidence = 0.2;  ///< of them: mean response over a template's features, 0..1

  /// @throws std::invalid_argument naming the value that is out of range.
  void validate() const;
};

/// What a search has found, and what it took.
struct TemplateFindings {
  PoseCandidates candidates;     ///< best first
  std::uint64_t lookups = 0;     ///< of responses at the features of templates
  double scan_s = 0, fit_s = 0;  ///< with the preparation of images
};

/// Looks for an object in an image by the orientations of gradients, without a hint: for objects
/// that have no texture, too (after LINE-2D: Hinterstoisser et al., "Gradient Response Maps for
/// Real-Time Detection of Textureless Objects", PAMI 2012).
///
/// The object is known as edges with orientations, seen from all around (TemplateBank). An image,
/// reduced so that an object at some distance spans as many pixels as templates do, responds to
/// each orientation at each pixel (OrientationResponses). The evidence for a template at a place is
/// the mean response at its features. What is different here:
///
/// - Features are also places where the object has no edge, and the image should have none: among
///   clutter there are edges of all orientations nearly everywhere.
/// - Where gradients of all orientations are close together the image does not respond, so that
///   clutter has no advantage over clean contours.
/// - The quarter of a template that fits worst does not count: it may be covered.
/// - A rotation in the image and a distance are no templates of their own: features are points in
///   space, which are turned and projected when they are needed. A bank takes less than 1 MiB.
/// - The best places of all templates are fitted with all features: to neighbouring rotations,
///   distances and views.
/// - Chance reaches more at some distances than at others. As many hits are fitted at each, and a
///   candidate's evidence is what it has beyond their median.
///
/// Candidates are starts for alignment, which decides. Not thread-safe.
class TemplateSearch {
 public:
  /// @param backend that matches. @throws std::invalid_argument for settings that are out of range
  /// or a bank that shows nothing.
  TemplateSearch(Backend* backend, std::shared_ptr<const TemplateBank> bank,
                 const FieldMetadata& object, const TemplateSearchSettings& settings);

  /// @param image [h][w][3] of `camera`: all that is searched. The object's centre is in it.
  /// @param layers of the camera: at each distance only what depth shows there; null: all of it.
  /// @throws std::invalid_argument for an image, a camera or distances that make no sense,
  /// Cancelled.
  TemplateFindings find(const Image& image, const Camera& camera, const DistanceRange& distances,
                        const CancellationToken& cancellation, const DepthLayers* layers = nullptr);

 private:
  TemplateMatches matchLayers(const DepthLayers& layers, const Image& image, const Camera& camera,
                              const std::vector<double>& distances,
                              const CancellationToken& cancellation);
  PoseCandidates candidatesOf(const Camera& camera, std::vector<TemplatePose> poses,
                              std::size_t distances) const;

  std::shared_ptr<const TemplateBank> bank_;
  FieldMetadata object_;
  TemplateSearchSettings settings_;
  std::unique_ptr<TemplateMatcher> matcher_;
};

}  // namespace nerf_pose_refiner
