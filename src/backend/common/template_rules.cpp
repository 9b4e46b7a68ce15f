// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/common/template_rules.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "math/angle.h"
#include "math/require.h"
#include "math/template_score.h"

namespace nerf_pose_refiner {
namespace {

bool isBetterHit(const TemplateHit& a, const TemplateHit& b) {
  return std::make_tuple(-a.score, a.view, a.rotation, a.row, a.column) <
         std::make_tuple(-b.score, b.view, b.rotation, b.row, b.column);
}

bool isSameImage(const Camera& a, const Camera& b) {
  return a.width == b.width && a.height == b.height && a.fx == b.fx && a.fy == b.fy &&
         a.cx == b.cx && a.cy == b.cy;
}

}  // namespace

std::size_t TemplateBank::memory_bytes() const {
  std::size_t bytes = views.size() * sizeof(TemplateView);
  for (const TemplateView& view : views) bytes += view.features.size() * sizeof(TemplateFeature);
  return bytes;
}

int TemplateBank::features() const {
  std::size_t most = 0;
  for (const TemplateView& view : views) most = std::max(most, view.features.size());
  return static_cast<int>(most);
}

void TemplateMatchSettings::validate() const {
  require(scanned_px >= 16 && scanned_px <= 512, "TemplateMatchSettings::scanned_px", scanned_px);
  require(fitted_px >= 16 && fitted_px <= 512, "TemplateMatchSettings::fitted_px", fitted_px);
  require(distance_step > 1.01, "TemplateMatchSettings::distance_step", distance_step);
  require(rotations >= 1 && rotations <= 360, "TemplateMatchSettings::rotations", rotations);
  require(hits_per_template >= 1, "TemplateMatchSettings::hits_per_template", hits_per_template);
  require(fitted >= 1, "TemplateMatchSettings::fitted", fitted);
}

TemplateScale templateScale(const Camera& camera, double distance, double object_px) {
  TemplateScale scale;
  const double focal = std::min(camera.fx, object_px * distance);
  const auto size = [focal](int pixels, double of_camera) {
    return std::max(1, static_cast<int>(std::lround(pixels * focal / of_camera)));
  };
  scale.camera = camera.resized(size(camera.width, camera.fx), size(camera.height, camera.fy));
  scale.object_px = scale.camera.fx / distance;
  return scale;
}

int templateMargin(const TemplateScale& scale, int stride) {
  constexpr double kRadius = 0.6, kNearer = 0.4, kNearest = 0.6;  // [diameters]
  const double distance = scale.distance();
  const double nearer = std::max(kNearest, distance - kNearer);
  const double reach = kRadius * scale.object_px * distance / nearer;
  return stride * static_cast<int>(std::ceil(reach / stride));
}

Eigen::Vector2d movedTo(const Camera& to, const Camera& from, const Eigen::Vector2d& pixel) {
  return {(pixel.x() - from.cx) * to.fx / from.fx + to.cx,
          (pixel.y() - from.cy) * to.fy / from.fy + to.cy};
}

TemplateLevels templateLevels(const Camera& camera, const std::vector<double>& distances,
                              double object_px, int stride) {
  TemplateLevels levels;
  for (const double distance : distances) {
    const TemplateScale scale = templateScale(camera, distance, object_px);
    const auto same =
        std::find_if(levels.cameras.begin(), levels.cameras.end(),
                     [&](const Camera& known) { return isSameImage(known, scale.camera); });
    const auto image = static_cast<std::size_t>(same - levels.cameras.begin());
    if (same == levels.cameras.end()) {
      levels.cameras.push_back(scale.camera);
      levels.margins.push_back(0);
    }
    levels.margins[image] = std::max(levels.margins[image], templateMargin(scale, stride));
    levels.scales.push_back(scale);
    levels.images.push_back(static_cast<int>(image));
  }
  return levels;
}

void keepBestHits(const TemplateMatchSettings& settings, std::vector<TemplateHit>* hits) {
  const auto best =
      std::min<std::ptrdiff_t>(settings.fitted, static_cast<std::ptrdiff_t>(hits->size()));
  std::partial_sort(hits->begin(), hits->begin() + best, hits->end(), isBetterHit);
  hits->resize(static_cast<std::size_t>(best));
}

void requireTemplateImage(const Image& image, const Camera& camera) {
  if (image.width != camera.width || image.height != camera.height || image.channels != 3) {
    throw std::invalid_argument("TemplateMatcher: the image has not its camera's size, or no RGB");
  }
}

void requireTemplates(const TemplateBank& bank) {
  const int features = bank.features();
  if (features == 0) throw std::invalid_argument("TemplateMatcher: no view shows anything");
  if (features > TemplateView::kMostFeatures) {
    throw std::invalid_argument("TemplateMatcher: a view has " + std::to_string(features) +
                                " features, must be at most " +
                                std::to_string(TemplateView::kMostFeatures));
  }
  for (const TemplateView& view : bank.views) {
    const int of_view = static_cast<int>(view.features.size());
    if (of_view != 0 && (of_view != features || of_view % TemplateView::kRun != 0)) {
      throw std::invalid_argument("TemplateMatcher: a view has " + std::to_string(of_view) +
                                  " features, must be a multiple of " +
                                  std::to_string(TemplateView::kRun) + ", in all views the same");
    }
  }
}

TemplatePose poseOf(const TemplateHit& hit, const TemplateMatchSettings& settings,
                    const TemplateScale& scale, int level) {
  TemplatePose pose;
  pose.view = hit.view;
  pose.rotation_rad = rotationOf(settings, hit.rotation);
  pose.distance = scale.distance();
  pose.pixel = Eigen::Vector2d(hit.column, hit.row) * kScanStride;
  pose.level = level;
  return pose;
}

double rotationOf(const TemplateMatchSettings& settings, int rotation) {
  return 2 * kPi * rotation / settings.rotations;
}

std::uint64_t scanLookups(const TemplateBank& bank, const TemplateMatchSettings& settings,
                          const Camera& camera) {
  const auto positions = static_cast<std::uint64_t>((camera.width + 1) / kScanStride) *
                         static_cast<std::uint64_t>((camera.height + 1) / kScanStride);
  std::uint64_t features = 0;
  for (const TemplateView& view : bank.views) features += view.features.size() / kScanFeatureStep;
  return positions * static_cast<std::uint64_t>(settings.rotations) * features;
}

std::vector<std::vector<ViewBeside>> viewsBeside(const TemplateBank& bank) {
  std::vector<std::vector<ViewBeside>> beside;
  for (const TemplateView& view : bank.views) {
    std::vector<std::pair<double, int>> others;
    for (std::size_t i = 0; i < bank.views.size(); ++i) {
      const TemplateView& other = bank.views[i];
      if (&other == &view || other.features.empty()) continue;
      others.emplace_back(-view.R_O_V.col(2).dot(other.R_O_V.col(2)), static_cast<int>(i));
    }
    std::sort(others.begin(), others.end());
    others.resize(std::min<std::size_t>(kViewsBeside, others.size()));
    beside.emplace_back();
    for (const auto& [opposite, number] : others) {
      const Eigen::Matrix3d turn =
          view.R_O_V.transpose() * bank.views[static_cast<std::size_t>(number)].R_O_V;
      beside.back().push_back(
          {number, std::atan2(turn(1, 0) - turn(0, 1), turn(0, 0) + turn(1, 1))});
    }
  }
  return beside;
}

TemplatePose moved(const TemplatePose& pose, const TemplateStep& step,
                   const TemplateMatchSettings& settings) {
  TemplatePose to = pose;
  to.rotation_rad += step.rotation * rotationOf(settings, 1);
  to.distance *= std::pow(settings.distance_step, step.distance);
  return to;
}

}  // namespace nerf_pose_refiner
