// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/template_search.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <stdexcept>
#include <tuple>
#include <utility>

#include "concurrency/parallel.h"
#include "concurrency/seconds_since.h"
#include "math/angle.h"
#include "math/require.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kScanStride = 2;  // [px]

bool isBetterHit(const TemplateHit& a, const TemplateHit& b) {
  return std::make_tuple(-a.score, a.level, a.view, a.rotation, a.pixel.y(), a.pixel.x()) <
         std::make_tuple(-b.score, b.level, b.view, b.rotation, b.pixel.y(), b.pixel.x());
}

/// What chance reaches at each distance: the median evidence of what was fitted there. Far objects
/// are looked for at more places, near ones among coarser edges.
std::vector<double> chanceAt(const std::vector<TemplateHit>& hits,
                             const std::vector<TemplatePose>& poses, std::size_t levels) {
  std::vector<std::vector<double>> evidence(levels);
  for (std::size_t i = 0; i < hits.size(); ++i) {
    evidence[static_cast<std::size_t>(hits[i].level)].push_back(poses[i].evidence);
  }
  std::vector<double> chance;
  for (std::vector<double>& here : evidence) {
    const auto middle = here.begin() + static_cast<std::ptrdiff_t>(here.size() / 2);
    if (middle != here.end()) std::nth_element(here.begin(), middle, here.end());
    chance.push_back(middle != here.end() ? *middle : 0);
  }
  return chance;
}

/// The same place in the same image, resized.
Eigen::Vector2d movedTo(const Camera& to, const Camera& from, const Eigen::Vector2d& pixel) {
  return {(pixel.x() - from.cx) * to.fx / from.fx + to.cx,
          (pixel.y() - from.cy) * to.fy / from.fy + to.cy};
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

/// An image, and the distances at which the object is looked for.
struct TemplateSearch::ImagePart {
  const Image& image;
  const Camera& camera;
  std::vector<double> distances;  // [diameters]

  TemplateScale scale(int level, double object_px) const {
    return templateScale(camera, distances[static_cast<std::size_t>(level)], object_px);
  }
};

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
  require(scanned_px >= 16 && scanned_px <= 512, "TemplateSearchSettings::scanned_px", scanned_px);
  require(fitted_px >= 16 && fitted_px <= 512, "TemplateSearchSettings::fitted_px", fitted_px);
  require(distance_step > 1.01, "TemplateSearchSettings::distance_step", distance_step);
  require(rotations >= 1 && rotations <= 360, "TemplateSearchSettings::rotations", rotations);
  require(hits_per_template >= 1, "TemplateSearchSettings::hits_per_template", hits_per_template);
  require(fitted >= 1, "TemplateSearchSettings::fitted", fitted);
  require(candidates >= 1, "TemplateSearchSettings::candidates", candidates);
  require(min_evidence >= 0 && min_evidence < 1, "TemplateSearchSettings::min_evidence",
          min_evidence);
  require(threads >= 0, "TemplateSearchSettings::threads", threads);
}

TemplateSearch::TemplateSearch(std::shared_ptr<const TemplateBank> bank,
                               const FieldMetadata& object, const TemplateSearchSettings& settings)
    : bank_(std::move(bank)),
      object_(object),
      settings_(settings),
      kernels_(selectTemplateKernels(settings.instruction_set)),
      fitter_(*bank_, kernels_, {2 * kPi / settings.rotations, settings.distance_step}) {
  settings_.validate();
  if (bank_->views.empty()) throw std::invalid_argument("TemplateSearch: the bank has no views");
}

TemplateFindings TemplateSearch::find(const Image& image, const Camera& camera,
                                      const DistanceRange& distances,
                                      const CancellationToken& cancellation) const {
  camera.validate();
  distances.validate();
  if (image.width != camera.width || image.height != camera.height || image.channels != 3) {
    throw std::invalid_argument("TemplateSearch: the image has not its camera's size, or no RGB");
  }
  ImagePart part = {image, camera, {}};
  const double range = std::log(distances.farthest / distances.nearest);
  const int steps = static_cast<int>(std::ceil(range / std::log(settings_.distance_step) - 1e-6));
  for (int i = 0; i <= steps; ++i) {
    part.distances.push_back(distances.nearest * std::exp(range * i / std::max(1, steps)));
  }
  TemplateFindings findings;
  auto begin = std::chrono::steady_clock::now();
  const std::vector<TemplateHit> hits = scan(part, cancellation, &findings.lookups);
  findings.scan_s = secondsSince(begin);
  begin = std::chrono::steady_clock::now();
  std::vector<TemplatePose> poses = fit(part, hits, cancellation, &findings.lookups);
  const std::vector<double> chance = chanceAt(hits, poses, part.distances.size());
  for (std::size_t i = 0; i < hits.size(); ++i) {
    double& evidence = poses[i].evidence;
    evidence = evidence < settings_.min_evidence
                   ? 0
                   : evidence - chance[static_cast<std::size_t>(hits[i].level)];
  }
  findings.candidates = candidatesOf(part, std::move(poses));
  findings.fit_s = secondsSince(begin);
  return findings;
}

std::vector<TemplateHit> TemplateSearch::scan(const ImagePart& part,
                                              const CancellationToken& cancellation,
                                              std::uint64_t* lookups) const {
  const ScanWork work = {settings_.hits_per_template, threadCount(settings_.threads), kernels_};
  const TemplateSet templates = {*bank_, settings_.rotations};
  const int share = std::max(1, settings_.fitted / static_cast<int>(part.distances.size()));
  std::vector<TemplateHit> all;
  for (int i = 0; i < static_cast<int>(part.distances.size()); ++i) {
    const TemplateLevel level = makeTemplateLevel(part.image, part.camera,
                                                  part.scale(i, settings_.scanned_px), kScanStride);
    std::vector<TemplateHit> here = scanLevel(level, templates, work, cancellation);
    for (TemplateHit& hit : here) hit.level = i;
    const Camera& camera = level.scale.camera;
    const auto positions = static_cast<std::uint64_t>((camera.width + 1) / kScanStride) *
                           static_cast<std::uint64_t>((camera.height + 1) / kScanStride);
    for (const TemplateView& view : bank_->views) {
      *lookups += positions * settings_.rotations * view.edges.size() / 2;
    }
    const auto best = std::min<std::ptrdiff_t>(share, static_cast<std::ptrdiff_t>(here.size()));
    std::partial_sort(here.begin(), here.begin() + best, here.end(), isBetterHit);
    all.insert(all.end(), here.begin(), here.begin() + best);
  }
  return all;
}

std::vector<TemplatePose> TemplateSearch::fit(const ImagePart& part,
                                              const std::vector<TemplateHit>& hits,
                                              const CancellationToken& cancellation,
                                              std::uint64_t* lookups) const {
  const int threads = threadCount(settings_.threads);
  const TemplateSet templates = {*bank_, settings_.rotations};
  std::vector<TemplatePose> poses(hits.size());
  std::vector<std::uint64_t> costs(hits.size(), 0);
  for (int i = 0; i < static_cast<int>(part.distances.size()); ++i) {
    std::vector<std::size_t> here;
    for (std::size_t k = 0; k < hits.size(); ++k) {
      if (hits[k].level == i) here.push_back(k);
    }
    if (here.empty()) continue;
    const TemplateLevel level =
        makeTemplateLevel(part.image, part.camera, part.scale(i, settings_.fitted_px), 1);
    const Camera scanned = part.scale(i, settings_.scanned_px).camera;
    parallelFor(threads, static_cast<int>(here.size()), [&](int k) {
      cancellation.check();
      const TemplateHit& hit = hits[here[k]];
      TemplatePose start;
      start.view = hit.view;
      start.rotation_rad = templates.turned(hit.view, hit.rotation).rotation_rad;
      start.distance = level.scale.distance();
      start.pixel = movedTo(level.scale.camera, scanned, hit.pixel);
      TemplatePose& pose = poses[here[k]];
      pose = fitter_.fit(level, start, &costs[here[k]]);
      pose.pixel = movedTo(part.camera, level.scale.camera, pose.pixel);
    });
  }
  for (const std::uint64_t cost : costs) *lookups += cost;
  return poses;
}

PoseCandidates TemplateSearch::candidatesOf(const ImagePart& part,
                                            std::vector<TemplatePose> poses) const {
  std::stable_sort(poses.begin(), poses.end(), [](const TemplatePose& a, const TemplatePose& b) {
    return a.evidence > b.evidence;
  });
  PoseCandidates candidates;
  for (const TemplatePose& pose : poses) {
    if (static_cast<int>(candidates.size()) == settings_.candidates) break;
    if (!(pose.evidence > 0)) break;
    const TemplateView& view = bank_->views[static_cast<std::size_t>(pose.view)];
    TemplateScale scale;
    scale.camera = part.camera;
    scale.object_px = part.camera.fx / pose.distance;
    const Pose T_O_C = posePlaced({&view, pose.rotation_rad}, scale, pose.pixel, object_);
    const bool is_known = std::any_of(
        candidates.begin(), candidates.end(),
        [&](const PoseCandidate& other) { return isSame(other.T_O_C, T_O_C, object_); });
    if (!is_known) candidates.push_back({T_O_C, pose.evidence, CandidateSource::kTemplates});
  }
  return candidates;
}

}  // namespace nerf_pose_refiner
