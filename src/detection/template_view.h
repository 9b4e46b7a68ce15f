// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "backend/loaded_field.h"

namespace nerf_pose_refiner {

struct FieldMetadata;

/// A place on an edge that a view of an object shows: on its contour, or inside where its colours
/// change.
struct TemplateEdge {
  Eigen::Vector3f point;  ///< relative to the object's centre, in the view's axes [diameters]
  float normal_rad;       ///< direction across the edge in the image; its sign says nothing
};

/// An object seen from one side, as edges alone. A template is made of it by a rotation in the
/// image, a size and a place (@see TemplatePlacement).
struct TemplateView {
  /// Of the parts that the edges are divided into by their places: some may be covered.
  static constexpr int kParts = 4;
  /// Numbers of edges are multiples of it: kernels take 16 of every part at a time, of every second
  /// edge, too.
  static constexpr int kRun = 2 * kParts * 16;

  Eigen::Matrix3d R_O_V;  ///< axes of the view's camera in O
  /// Part after part, equally many in each. Every second one alone makes as even a choice. Empty:
  /// this view shows next to nothing.
  std::vector<TemplateEdge> edges;
};

/// The edges of a rendering whose camera looks at the object's centre.
/// @param count of edges, a multiple of TemplateView::kRun; where a view shows fewer, some
/// count twice.
TemplateView makeTemplateView(const Rendering& rendering, const View& view,
                              const FieldMetadata& object, int count);

struct TemplateBankSettings {
  int views = 300;        ///< from all around: some 12 degrees apart
  int object_px = 128;    ///< that the object's diameter spans in a rendering
  double distance = 2.8;  ///< of the camera from the object's centre [diameters]
  int edges = 128;        ///< of a view, a multiple of TemplateView::kRun

  /// @throws std::invalid_argument naming the value that is out of range.
  void validate() const;
};

/// An object from all around.
struct TemplateBank {
  std::vector<TemplateView> views;

  std::size_t memory_bytes() const;
};

/// Renders an object from all around. @throws std::invalid_argument for settings that are out of
/// range, Cancelled.
TemplateBank makeTemplateBank(const LoadedField& field, const TemplateBankSettings& settings,
                              const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
