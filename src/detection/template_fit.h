// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "detection/template_kernels.h"
#include "detection/template_scan.h"

namespace nerf_pose_refiner {

/// A view of an object, turned in the image, at a distance and a place.
struct TemplatePose {
  int view = 0;
  double rotation_rad = 0;
  double distance = 0;    ///< of the object's centre [diameters]
  Eigen::Vector2d pixel;  ///< of it, in the level's image
  double evidence = -1;   ///< mean response over the edges that count, 0..1
};

/// Steps from a pose to its neighbours: those between templates.
struct TemplateSteps {
  double rotation_rad;
  double distance;  ///< a factor
};

/// Improves poses of templates in an image that shows the object larger, with all edges: the best
/// of neighbouring rotations and distances, then of neighbouring views, then of smaller steps.
class TemplateFitter {
 public:
  /// @param bank lives longer.
  TemplateFitter(const TemplateBank& bank, const TemplateKernels& kernels,
                 const TemplateSteps& steps);

  /// @param level of stride 1. @param lookups of responses are added to it.
  TemplatePose fit(const TemplateLevel& level, const TemplatePose& start,
                   std::uint64_t* lookups) const;

 private:
  std::vector<TemplatePose> turnedAndMoved(const TemplatePose& pose) const;
  std::vector<TemplatePose> fromBeside(const TemplatePose& pose) const;
  std::vector<TemplatePose> closeTo(const TemplatePose& pose) const;

  const TemplateBank& bank_;
  const TemplateKernels& kernels_;
  TemplateSteps steps_;
  std::vector<std::vector<int>> neighbours_;  // of each view
};

}  // namespace nerf_pose_refiner
