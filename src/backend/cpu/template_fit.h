// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "backend/common/template_rules.h"
#include "backend/cpu/template_kernels.h"
#include "backend/cpu/template_scan.h"

namespace nerf_pose_refiner {

/// Improves poses of templates in an image that shows the object larger, with all edges: the best
/// of neighbouring rotations and distances, then of neighbouring views, then of smaller steps.
class TemplateFitter {
 public:
  /// @param templates live longer, as the kernels do.
  TemplateFitter(const TemplateSet& templates, const TemplateKernels& kernels)
      : templates_(templates), kernels_(kernels), beside_(viewsBeside(templates.bank)) {}

  /// @param level of stride 1. @param lookups of responses are added to it.
  TemplatePose fit(const TemplateLevel& level, const TemplatePose& start,
                   std::uint64_t* lookups) const;

 private:
  TemplateSet templates_;
  const TemplateKernels& kernels_;
  std::vector<std::vector<ViewBeside>> beside_;
};

}  // namespace nerf_pose_refiner
