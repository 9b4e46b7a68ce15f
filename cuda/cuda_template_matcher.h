// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/common/template_rules.h"
#include "backend/template_matcher.h"
#include "device_memory.h"
#include "template_match.h"
#include "template_responses.h"

namespace nerf_pose_refiner {

/// Matches templates on a CUDA device. Nothing of it is shared with what else its backend does, and
/// its stream goes last.
class CudaTemplateMatcher final : public TemplateMatcher {
 public:
  /// @param device the calling thread's.
  CudaTemplateMatcher(int device, std::shared_ptr<const TemplateBank> bank,
                      const TemplateMatchSettings& settings);
  ~CudaTemplateMatcher() override;

  TemplateMatches match(const Image& image, const Camera& camera,
                        const std::vector<double>& distances,
                        const CancellationToken& cancellation) override;

 private:
  /// How reductions of an image respond, on the device.
  struct Responses {
    std::vector<DeviceBuffer<std::uint8_t>> of_image;
    std::vector<ResponseOrder> orders;
  };
  /// Room for one image at a time.
  struct Scratch {
    DeviceBuffer<float> colours, smooth, half;
    DeviceBuffer<EdgeGradient> gradients;
    DeviceBuffer<std::uint8_t> agreements;
    DeviceBuffer<unsigned> counts;
  };

  ResponseScratch scratchFor(std::size_t pixels);
  void respond(const Camera& camera, const TemplateLevels& levels, int stride, Responses* to);
  std::vector<CudaTemplateLevel> levelsOf(const TemplateLevels& levels,
                                          const Responses& responses) const;
  std::vector<TemplateHit> hitsOf(std::size_t level) const;
  void scan(const TemplateLevels& levels, const CancellationToken& cancellation);
  void fit(const TemplateLevels& levels, std::vector<TemplatePose>* poses);

  int device_;
  std::shared_ptr<const TemplateBank> bank_;
  TemplateMatchSettings settings_;
  CudaStream stream_;
  CudaTemplates templates_ = {};
  DeviceBuffer<CudaTemplateFeature> features_;
  std::vector<int> shown_;
  DeviceBuffer<int> shown_on_device_, beside_;
  DeviceBuffer<double> turns_;

  DeviceBuffer<float> image_;
  Scratch scratch_;
  Responses scanned_, fitted_;
  DeviceBuffer<PeakKey> tiles_, best_;  ///< the latter of all levels
  PinnedBuffer<PeakKey> found_;
  DeviceBuffer<CudaTemplateLevel> levels_;
  DeviceBuffer<CudaTemplatePose> poses_;
};

}  // namespace nerf_pose_refiner
