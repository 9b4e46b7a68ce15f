// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/template_search.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "detection/placed_template.h"
#include "field/field.h"
#include "math/angle.h"
#include "math/median.h"
#include "math/require.h"

namespace nerf_pose_refiner {
namespace {

/// What chance reaches at each distance: the median evidence of what was fitted there. Far objects
/// are looked for at more places, near ones among coarser features.
std::vector<double> chanceAt(const std::vector<TemplatePose>& poses, std::size_t levels) {
  std::vector<std::vector<double>> evidence(levels);
  for (const TemplatePose& pose : poses) {
    evidence[static_cast<std::size_t>(pose.level)].push_back(pose.evidence);
  }
  std::vector<double> chance;
  for (std::vector<double>& here : evidence) chance.push_back(medianOf(std::move(here)));
  return chance;
}

/// Whether two poses look nearly the same.
bool isSame(const Pose& a, const Pose& b, const FieldMetadata& object) {
  constexpr double kRotation = 12 * kPi / 180, kAcross = 0.12, kAlong = 0.06;
  const Pose nearest = nearestEquivalent(a, b, object.symmetries);
  const Eigen::Vector3d a_C = nearest.inverse() * object.centre, b_C = b.inverse() * object.centre;
  return rotationDistance(nearest.R, b.R) < kRotation &&
         (a_C - b_C).norm() < std::max(kAcross * object.diameter, kAlong * b_C.norm());
}

}  // namespace

DistanceRange DistanceRange::usual(const Camera& camera) {
  constexpr double kNearest = 0.8;  // nearer, a part of the object is beside or behind the camera
  const double whole = camera.fx / std::max(camera.width, camera.height);
  return {std::max(kNearest, whole), std::max(kNearest, 8 * whole)};
}

void DistanceRange::validate() const {
  if (!(std::isfinite(farthest) && nearest > 0.5 && farthest >= nearest)) {
    throw std::invalid_argument("DistanceRange: from " + std::to_string(nearest) + " to " +
                                std::to_string(farthest) + " diameters");
  }
}

void TemplateSearchSettings::validate() const {
  matching.validate();
  require(candidates >= 1, "TemplateSearchSettings::candidates", candidates);
  require(min_evidence >= 0 && min_evidence < 1, "TemplateSearchSettings::min_evidence",
          min_evidence);
}

TemplateSearch::TemplateSearch(Backend* backend, std::shared_ptr<const TemplateBank> bank,
                               const FieldMetadata& object, const TemplateSearchSettings& settings)
    : bank_(std::move(bank)), object_(object), settings_(settings) {
  settings_.validate();
  matcher_ = backend->makeTemplateMatcher(bank_, settings_.matching);
}

TemplateFindings TemplateSearch::find(const Image& image, const Camera& camera,
                                      const DistanceRange& distances,
                                      const CancellationToken& cancellation,
                                      const DepthLayers* layers) {
  camera.validate();
  distances.validate();
  const double range = std::log(distances.farthest / distances.nearest);
  const double step = std::log(settings_.matching.distance_step);
  const int steps = static_cast<int>(std::ceil(range / step - 1e-6));
  std::vector<double> scanned;
  for (int i = 0; i <= steps; ++i) {
    scanned.push_back(distances.nearest * std::exp(range * i / std::max(1, steps)));
  }
  TemplateMatches matches = layers == nullptr
                                ? matcher_->match(image, camera, scanned, cancellation)
                                : matchLayers(*layers, image, camera, scanned, cancellation);
  // In a layer with little in it, what matches is the object. Where there is nothing, a quarter of
  // the features respond: those without an edge.
  constexpr double kOfNothing = 0.25;
  const std::vector<double> chance = layers == nullptr
                                         ? chanceAt(matches.poses, scanned.size())
                                         : std::vector<double>(scanned.size(), kOfNothing);
  for (TemplatePose& pose : matches.poses) {
    pose.evidence = pose.evidence < settings_.min_evidence
                        ? 0
                        : pose.evidence - chance[static_cast<std::size_t>(pose.level)];
  }
  TemplateFindings findings;
  findings.candidates = candidatesOf(camera, std::move(matches.poses), scanned.size());
  findings.lookups = matches.lookups;
  findings.scan_s = matches.scan_s;
  findings.fit_s = matches.fit_s;
  return findings;
}

/// The same as the matcher's for all distances at once.
TemplateMatches TemplateSearch::matchLayers(const DepthLayers& layers, const Image& image,
                                            const Camera& camera,
                                            const std::vector<double>& distances,
                                            const CancellationToken& cancellation) {
  const double reach = std::sqrt(settings_.matching.distance_step);
  TemplateMatches all;
  for (std::size_t level = 0; level < distances.size(); ++level) {
    const auto layer = layers.at(distances[level], reach, image);
    if (!layer) continue;
    const PixelWindow& window = layer->window;
    const Camera part = camera.cropped(window.x, window.y, window.width, window.height);
    const TemplateMatches here =
        matcher_->match(layer->colours, part, {distances[level]}, cancellation);
    for (TemplatePose pose : here.poses) {
      pose.level = static_cast<int>(level);
      pose.pixel += Eigen::Vector2d(window.x, window.y);
      all.poses.push_back(pose);
    }
    all.lookups += here.lookups;
    all.scan_s += here.scan_s;
    all.fit_s += here.fit_s;
  }
  return all;
}

PoseCandidates TemplateSearch::candidatesOf(const Camera& camera, std::vector<TemplatePose> poses,
                                            std::size_t distances) const {
  const std::size_t most = distances * static_cast<std::size_t>(settings_.candidates);
  std::stable_sort(poses.begin(), poses.end(), [](const TemplatePose& a, const TemplatePose& b) {
    return a.evidence > b.evidence;
  });
  PoseCandidates candidates;
  for (const TemplatePose& pose : poses) {
    if (candidates.size() == most) break;
    if (!(pose.evidence > 0)) break;
    const TemplateView& view = bank_->views[static_cast<std::size_t>(pose.view)];
    TemplateScale scale;
    scale.camera = camera;
    scale.object_px = camera.fx / pose.distance;
    const Pose T_O_C = posePlaced({&view, pose.rotation_rad}, scale, pose.pixel, object_);
    const bool is_known = std::any_of(
        candidates.begin(), candidates.end(),
        [&](const PoseCandidate& other) { return isSame(other.T_O_C, T_O_C, object_); });
    if (!is_known) candidates.push_back({T_O_C, pose.evidence, CandidateSource::kTemplates});
  }
  return candidates;
}

}  // namespace nerf_pose_refiner
