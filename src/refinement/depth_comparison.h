// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "field/field.h"
#include "math/keyframe_alignment.h"
#include "nerf_pose_refiner/depth.h"
#include "refinement/depth_outline.h"
#include "refinement/depth_surface.h"

namespace nerf_pose_refiner {

/// How the places of a surface compare with a depth image.
struct DepthCounts {
  int facing = 0;    ///< in the depth image and not hidden by the object itself
  int measured = 0;  ///< of these: have a depth that is not at an edge
  int agreeing = 0;  ///< of these: ... lies where the pose puts it
  int nearer = 0;    ///< of these: ... something is before it
  int farther = 0;   ///< of these: ... is seen through
  // Places of the outline, where it was looked at:
  int edges = 0;           ///< neither hidden nor without depth
  int agreeing_edges = 0;  ///< of these: depth falls off where the pose puts the outline
};

/// Fewer places say nothing of a pose.
constexpr int kFewestDepthPlaces = 40;

/// A part of some places; 0: there are none.
double fractionOf(int part, int whole);

/// What they say to users: all but whether depth is used.
DepthReport reportOf(const DepthCounts& counts);

/// The part of what is measured that is not hidden.
double shownFraction(const DepthCounts& counts);

/// Residuals below it agree [deviations].
constexpr double kDepthAgrees = 3;

/// A place of the surface, compared with its pixel; lengths in model units.
struct ComparedDepth {
  PlaneDepth<double> plane;
  double measured, deviation;
  int tile;
  int x, y;  ///< its pixel
};

/// A place of the outline, compared with the edge that the image shows beside it.
struct ComparedEdge {
  DepthEdge edge;
  double jacobian[6];  ///< of the place, outwards [px], for motions of the camera as in moveCamera
  int tile;
};

/// Compares a surface with a depth image, pose by pose.
class DepthComparison {
 public:
  /// All must outlive it. @param object has a metric scale.
  DepthComparison(const DepthSurface& surface, const DepthImage& depth,
                  const FieldMetadata& object);

  /// Finds the places that the object hides from the depth camera; the same for poses nearby.
  void findHidden(const Pose& T_O_C);

  /// Compares the surface at a pose; the outline, too, if that is wanted.
  void compare(const Pose& T_O_C, double bias, bool outline);

  /// Of the pose that was compared last: @{
  const std::vector<ComparedDepth>& places() const { return places_; }
  const std::vector<ComparedEdge>& edges() const { return edges_; }
  /// Measured by expected depth, also of pixels at edges.
  const std::vector<double>& ratios() const { return ratios_; }
  DepthCounts count(double bias) const;
  /// The part of the measured places that some smooth surface, quadratic in the image, explains as
  /// well: what it explains speaks for no object.
  double smoothAgreement() const;
  /// @}

  /// Pixels between neighbouring places of the surface, about.
  double spacing_px() const;
  /// The same of the outline.
  double outlineSpacing_px() const;

 private:
  void comparePlace(const PointTransform<double>& in_depth, std::size_t i);
  void compareEdge(const PointTransform<double>& in_depth, double bias, std::size_t i);
  bool isAtEdge(int x, int y, float centre_m) const;

  const DepthSurface& surface_;
  const DepthImage& depth_;
  const FieldMetadata& object_;
  double unit_m_;
  Pose T_C_D_;  // [model units]
  Pinhole<double> K_;
  std::vector<char> is_hidden_;  // of each place: the object hides it itself
  std::vector<ComparedDepth> places_;
  std::vector<ComparedEdge> edges_;
  std::vector<double> ratios_;
  int facing_ = 0;
  double distance_ = 1;  // of the object's centre, along the optical axis [model units]
};

}  // namespace nerf_pose_refiner
