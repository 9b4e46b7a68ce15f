// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "backend/loaded_field.h"
#include "backend/template_matcher.h"

namespace nerf_pose_refiner {

struct FieldMetadata;

/// The features of a rendering whose camera looks at the object's centre: edges, and a quarter of
/// places without one, if it shows so many.
/// @param count of features, a multiple of TemplateView::kRun; where a view shows fewer edges, some
/// count twice.
TemplateView makeTemplateView(const Rendering& rendering, const View& view,
                              const FieldMetadata& object, int count);

struct TemplateBankSettings {
  int views = 300;        ///< from all around: some 12 degrees apart
  int object_px = 128;    ///< that the object's diameter spans in a rendering
  double distance = 2.8;  ///< of the camera from the object's centre [diameters]
  int features = 128;     ///< of a view, a multiple of TemplateView::kRun

  /// @throws std::invalid_argument naming the value that is out of range.
  void validate() const;
};

/// Renders an object from all around. @throws std::invalid_argument for settings that are out of
/// range, Cancelled.
TemplateBank makeTemplateBank(const LoadedField& field, const TemplateBankSettings& settings,
                              const CancellationToken& cancellation);

}  // namespace nerf_pose_refiner
