// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/template_matcher.h"
#include "support/scene_backend.h"

namespace nerf_pose_refiner {

/// Finds no template anywhere, and notes where it looked.
class NotingBackend final : public SceneBackend {
 public:
  /// What a matcher was asked for.
  struct Asked {
    int width;                      ///< of the image [px]
    std::vector<double> distances;  ///< [diameters]
  };

  using SceneBackend::SceneBackend;

  std::unique_ptr<TemplateMatcher> makeTemplateMatcher(std::shared_ptr<const TemplateBank>,
                                                       const TemplateMatchSettings&) override {
    return std::make_unique<Matcher>(&asked);
  }

  std::vector<Asked> asked;

 private:
  class Matcher final : public TemplateMatcher {
   public:
    explicit Matcher(std::vector<Asked>* asked) : asked_(asked) {}
    TemplateMatches match(const Image& image, const Camera&, const std::vector<double>& distances,
                          const CancellationToken&) override {
      asked_->push_back({image.width, distances});
      return {};
    }

   private:
    std::vector<Asked>* asked_;
  };
};

}  // namespace nerf_pose_refiner
