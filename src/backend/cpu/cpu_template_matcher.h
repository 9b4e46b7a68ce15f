// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/cpu/template_fit.h"
#include "backend/cpu/template_kernels.h"
#include "backend/template_matcher.h"

namespace nerf_pose_refiner {

/// Matches templates on the CPU.
class CpuTemplateMatcher final : public TemplateMatcher {
 public:
  CpuTemplateMatcher(std::shared_ptr<const TemplateBank> bank,
                     const TemplateMatchSettings& settings, const ScanWork& work);

  TemplateMatches match(const Image& image, const Camera& camera,
                        const std::vector<double>& distances,
                        const CancellationToken& cancellation) override;

 private:
  std::shared_ptr<const TemplateBank> bank_;
  TemplateMatchSettings settings_;
  ScanWork work_;
  TemplateFitter fitter_;
};

}  // namespace nerf_pose_refiner
