// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "math/template_score.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/image.h"

namespace nerf_pose_refiner {

/// A place that a view of an object shows: on its contour, inside where its colours change, or
/// where they do not.
struct TemplateFeature {
  Eigen::Vector3f point;  ///< relative to the object's centre, in the view's axes [diameters]
  float normal_rad;  ///< direction across the edge in the image, whose sign says nothing; kNoNormal
};

/// An object seen from one side, as places with and without an edge. A template is made of it by a
/// rotation in the image, a size and a place.
struct TemplateView {
  /// Numbers of features are multiples of it: kernels take so many of a part at once, also in a
  /// scan, where not all features count.
  static constexpr int kRun = kScanFeatureStep * kTemplateParts * kFeaturesPerSum;
  static constexpr int kMostFeatures = 2048;  ///< sums of their responses fit into 15 bits

  Eigen::Matrix3d R_O_V;  ///< axes of the view's camera in O
  /// Part after part, equally many in each. Every second one alone makes as even a choice. Empty:
  /// this view shows next to nothing.
  std::vector<TemplateFeature> features;
};

/// An object from all around.
struct TemplateBank {
  std::vector<TemplateView> views;

  std::size_t memory_bytes() const;
  /// Of a view that has any; 0: none has. All have equally many.
  int features() const;
};

/// How templates are matched.
struct TemplateMatchSettings {
  double scanned_px = 72;      ///< that the object spans where all of the image is looked through
  double fitted_px = 192;      ///< the same where what was found is fitted
  double distance_step = 1.2;  ///< from a distance to the next, a factor
  int rotations = 20;          ///< of a view in the image, evenly over the circle
  int hits_per_template = 3;   ///< of each view, rotation and distance
  int fitted = 400;            ///< best hits of each distance

  /// @throws std::invalid_argument naming the value that is out of range.
  void validate() const;
};

/// A view of an object, turned in the image, at a distance and a place.
struct TemplatePose {
  int view = 0;
  double rotation_rad = 0;  ///< from the image's axis x to its axis y
  double distance = 0;      ///< of the object's centre [diameters]
  Eigen::Vector2d pixel;    ///< of it
  double evidence = -1;     ///< mean response over the features that count, 0..1
  int level = 0;            ///< number of the distance at which it was looked for
};

/// Where templates match an image, and what it took to find out.
struct TemplateMatches {
  std::vector<TemplatePose> poses;  ///< level after level, of each the best hits first
  std::uint64_t lookups = 0;        ///< of responses at the features of templates
  double scan_s = 0, fit_s = 0;     ///< with the preparation of images
};

/// Matches templates of an object with images. One caller at a time; it may be used beside all else
/// that its backend made.
class TemplateMatcher {
 public:
  virtual ~TemplateMatcher() = default;

  /// The best places of all views, rotations and distances, fitted with all features to
  /// neighbouring rotations, distances and views.
  /// @param image [h][w][3] of `camera`. @param distances of the object's centre that are scanned
  /// [diameters]. @throws std::invalid_argument for an image that has not its camera's size, or no
  /// RGB, Cancelled.
  virtual TemplateMatches match(const Image& image, const Camera& camera,
                                const std::vector<double>& distances,
                                const CancellationToken& cancellation) = 0;
};

}  // namespace nerf_pose_refiner
