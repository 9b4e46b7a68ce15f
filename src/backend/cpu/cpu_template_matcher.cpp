// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_template_matcher.h"

#include <chrono>
#include <utility>

#include "backend/cpu/template_responses.h"
#include "backend/cpu/template_scan.h"
#include "concurrency/parallel.h"
#include "concurrency/seconds_since.h"
#include "image/resample.h"

namespace nerf_pose_refiner {
namespace {

using Memories = std::vector<std::unique_ptr<const ResponseMemory>>;

/// What an image's reductions respond. Large ones take longest: they begin first.
Memories memoriesOf(const Image& image, const Camera& camera, const TemplateLevels& levels,
                    int stride, int threads) {
  const int count = static_cast<int>(levels.cameras.size());
  Memories memories(levels.cameras.size());
  parallelFor(threads, count, [&](int i) {
    const auto number = static_cast<std::size_t>(count - 1 - i);
    memories[number] = std::make_unique<const ResponseMemory>(
        orientationResponses(resample(image, camera, levels.cameras[number])), stride,
        levels.margins[number]);
  });
  return memories;
}

TemplateLevel levelOf(const TemplateLevels& levels, const Memories& memories, std::size_t i) {
  return {levels.scales[i], *memories[static_cast<std::size_t>(levels.images[i])]};
}

}  // namespace

CpuTemplateMatcher::CpuTemplateMatcher(std::shared_ptr<const TemplateBank> bank,
                                       const TemplateMatchSettings& settings, const ScanWork& work)
    : bank_(std::move(bank)),
      settings_(settings),
      work_(work),
      fitter_({*bank_, settings_}, work.kernels) {}

TemplateMatches CpuTemplateMatcher::match(const Image& image, const Camera& camera,
                                          const std::vector<double>& distances,
                                          const CancellationToken& cancellation) {
  requireTemplateImage(image, camera);
  TemplateMatches found;
  auto begin = std::chrono::steady_clock::now();
  const TemplateLevels scanned =
      templateLevels(camera, distances, settings_.scanned_px, kScanStride);
  const Memories small = memoriesOf(image, camera, scanned, kScanStride, work_.threads);
  for (std::size_t i = 0; i < distances.size(); ++i) {
    std::vector<TemplateHit> hits =
        scanLevel(levelOf(scanned, small, i), {*bank_, settings_}, work_, cancellation);
    found.lookups += scanLookups(*bank_, settings_, scanned.scales[i].camera);
    keepBestHits(settings_, &hits);
    for (const TemplateHit& hit : hits) {
      found.poses.push_back(poseOf(hit, settings_, scanned.scales[i], static_cast<int>(i)));
    }
  }
  found.scan_s = secondsSince(begin);

  begin = std::chrono::steady_clock::now();
  const TemplateLevels fitted = templateLevels(camera, distances, settings_.fitted_px, 1);
  const Memories large = memoriesOf(image, camera, fitted, 1, work_.threads);
  std::vector<std::uint64_t> lookups(found.poses.size(), 0);
  parallelFor(work_.threads, static_cast<int>(found.poses.size()), [&](int k) {
    cancellation.check();
    TemplatePose& pose = found.poses[static_cast<std::size_t>(k)];
    const auto i = static_cast<std::size_t>(pose.level);
    const TemplateLevel level = levelOf(fitted, large, i);
    pose.pixel = movedTo(level.scale.camera, scanned.scales[i].camera, pose.pixel);
    pose = fitter_.fit(level, pose, &lookups[static_cast<std::size_t>(k)]);
    pose.pixel = movedTo(camera, level.scale.camera, pose.pixel);
  });
  for (const std::uint64_t of_pose : lookups) found.lookups += of_pose;
  found.fit_s = secondsSince(begin);
  return found;
}

}  // namespace nerf_pose_refiner
