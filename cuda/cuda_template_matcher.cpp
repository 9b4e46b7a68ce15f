// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_template_matcher.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <utility>

#include "concurrency/seconds_since.h"

namespace nerf_pose_refiner {
namespace {

/// What a fit looks up, at most: windows at the border of an image are smaller.
std::uint64_t fitLookups(int features) {
  const auto window = [](int round) {
    const std::uint64_t side = 2 * fitReach(round) + 1;
    return side * side;
  };
  return static_cast<std::uint64_t>(features) *
         (kTurnedAndMoved * window(0) + kViewsBeside * window(1) + kClose * window(2));
}

}  // namespace

CudaTemplateMatcher::CudaTemplateMatcher(int device, std::shared_ptr<const TemplateBank> bank,
                                         const TemplateMatchSettings& settings)
    : device_(device), bank_(std::move(bank)), settings_(settings) {
  const int count = bank_->features();
  std::vector<CudaTemplateFeature> features(bank_->views.size() * static_cast<std::size_t>(count));
  const std::vector<std::vector<ViewBeside>> all_beside = viewsBeside(*bank_);
  std::vector<int> beside(bank_->views.size() * kViewsBeside, -1);
  std::vector<double> turns(beside.size(), 0);
  for (std::size_t view = 0; view < bank_->views.size(); ++view) {
    const std::vector<TemplateFeature>& of_view = bank_->views[view].features;
    if (!of_view.empty()) shown_.push_back(static_cast<int>(view));
    std::transform(
        of_view.begin(), of_view.end(),
        features.begin() + static_cast<std::ptrdiff_t>(view) * count,
        [](const TemplateFeature& feature) -> CudaTemplateFeature {
          return {{feature.point.x(), feature.point.y(), feature.point.z()}, feature.normal_rad};
        });
    for (std::size_t k = 0; k < all_beside[view].size(); ++k) {
      beside[view * kViewsBeside + k] = all_beside[view][k].view;
      turns[view * kViewsBeside + k] = all_beside[view][k].turn_rad;
    }
  }
  features_.upload(features, stream_);
  shown_on_device_.upload(shown_, stream_);
  beside_.upload(beside, stream_);
  turns_.upload(turns, stream_);
  stream_.wait();
  templates_ = {features_.data(), shown_on_device_.data(), static_cast<int>(shown_.size()), count,
                settings.rotations};
}

CudaTemplateMatcher::~CudaTemplateMatcher() {
  cudaSetDevice(device_);  // a destructor never throws
  cudaStreamSynchronize(stream_);
}

ResponseScratch CudaTemplateMatcher::scratchFor(std::size_t pixels) {
  scratch_.colours.reserve(3 * pixels);
  scratch_.smooth.reserve(3 * pixels);
  scratch_.gradients.reserve(pixels);
  scratch_.agreements.reserve(kOrientations * pixels);
  scratch_.counts.reserve(std::size_t{1} << kLengthBits);
  scratch_.half.reserve(1);
  return {scratch_.colours.data(),    scratch_.smooth.data(), scratch_.gradients.data(),
          scratch_.agreements.data(), scratch_.counts.data(), scratch_.half.data()};
}

/// Enqueues it. The image is on the device. @param camera of it.
void CudaTemplateMatcher::respond(const Camera& camera, const TemplateLevels& levels, int stride,
                                  Responses* to) {
  to->of_image.resize(std::max(to->of_image.size(), levels.cameras.size()));
  to->orders.clear();
  ResponseTask task = {};
  task.image = image_.data();
  task.from_columns = axisX(camera);
  task.from_rows = axisY(camera);
  for (int bin = 0; bin < kOrientations; ++bin) task.directions[bin] = doubledDirection(bin);
  std::size_t most = 0;
  for (const Camera& one : levels.cameras) {
    most = std::max(most, static_cast<std::size_t>(one.width) * one.height);
  }
  task.scratch = scratchFor(most);
  for (std::size_t i = 0; i < levels.cameras.size(); ++i) {
    const Camera& reduced = levels.cameras[i];
    task.columns = axisX(reduced);
    task.rows = axisY(reduced);
    task.order = ResponseOrder::of(reduced.width, reduced.height, stride, levels.margins[i]);
    // Lanes look beyond the last column, and at words.
    to->of_image[i].clear(static_cast<std::size_t>(task.order.size()) + 2 * kTileColumns, stream_);
    task.responses = to->of_image[i].data();
    to->orders.push_back(task.order);
    makeResponses(task, stream_);
  }
}

std::vector<CudaTemplateLevel> CudaTemplateMatcher::levelsOf(const TemplateLevels& levels,
                                                             const Responses& responses) const {
  std::vector<CudaTemplateLevel> all;
  for (std::size_t i = 0; i < levels.scales.size(); ++i) {
    const auto image = static_cast<std::size_t>(levels.images[i]);
    const Camera& camera = levels.scales[i].camera;
    all.push_back({responses.of_image[image].data(), responses.orders[image], camera.width,
                   camera.height, static_cast<float>(camera.fx), levels.scales[i].distance()});
  }
  return all;
}

/// Level after level, to `found_`.
void CudaTemplateMatcher::scan(const TemplateLevels& levels,
                               const CancellationToken& cancellation) {
  const std::size_t templates = shown_.size() * static_cast<std::size_t>(settings_.rotations);
  const std::size_t per_level = templates * static_cast<std::size_t>(settings_.hits_per_template);
  const std::vector<CudaTemplateLevel> all = levelsOf(levels, scanned_);
  std::size_t most_tiles = 0;
  for (const CudaTemplateLevel& level : all) {
    const int tiles = TileGrid::of(level.width, level.height).size();
    most_tiles = std::max(most_tiles, static_cast<std::size_t>(tiles));
  }
  tiles_.reserve(templates * most_tiles);
  best_.reserve(per_level * all.size());
  found_.reserve(per_level * all.size());
  for (std::size_t i = 0; i < all.size(); ++i) {
    cancellation.check();
    scanTemplates({templates_, all[i], tiles_.data(), best_.data() + i * per_level,
                   settings_.hits_per_template},
                  stream_);
    stream_.wait();  // else all levels would be under way before a cancellation is noticed
  }
  NPR_CUDA_CHECK(cudaMemcpyAsync(found_.data(), best_.data(),
                                 per_level * all.size() * sizeof(PeakKey), cudaMemcpyDeviceToHost,
                                 stream_));
  stream_.wait();
}

std::vector<TemplateHit> CudaTemplateMatcher::hitsOf(std::size_t level) const {
  const auto per_template = static_cast<std::size_t>(settings_.hits_per_template);
  const auto rotations = static_cast<std::size_t>(settings_.rotations);
  const std::size_t per_level = shown_.size() * rotations * per_template;
  const PeakKey* found = found_.data() + level * per_level;
  std::vector<TemplateHit> hits;
  for (std::size_t k = 0; k < per_level; ++k) {
    if (found[k] == 0) continue;
    const std::size_t one = k / per_template;
    const Peak peak = peakOf(found[k]);
    hits.push_back({peak.score, shown_[one / rotations], static_cast<int>(one % rotations),
                    peak.column, peak.row});
  }
  return hits;
}

/// @param poses their pixels in the images that are fitted.
void CudaTemplateMatcher::fit(const TemplateLevels& levels, std::vector<TemplatePose>* poses) {
  if (poses->empty()) return;
  levels_.upload(levelsOf(levels, fitted_), stream_);
  std::vector<CudaTemplatePose> starts;
  for (const TemplatePose& pose : *poses) {
    starts.push_back({pose.view, pose.level, static_cast<int>(std::lround(pose.pixel.x())),
                      static_cast<int>(std::lround(pose.pixel.y())), pose.rotation_rad,
                      pose.distance, -1});
  }
  poses_.upload(starts, stream_);
  fitTemplates({templates_, levels_.data(), beside_.data(), turns_.data(), rotationOf(settings_, 1),
                settings_.distance_step, poses_.data(), static_cast<int>(starts.size())},
               stream_);
  NPR_CUDA_CHECK(cudaMemcpyAsync(starts.data(), poses_.data(),
                                 starts.size() * sizeof(CudaTemplatePose), cudaMemcpyDeviceToHost,
                                 stream_));
  stream_.wait();
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const CudaTemplatePose& from = starts[i];
    (*poses)[i] = {from.view,        from.rotation_rad, from.distance,
                   {from.x, from.y}, from.evidence,     from.level};
  }
}

TemplateMatches CudaTemplateMatcher::match(const Image& image, const Camera& camera,
                                           const std::vector<double>& distances,
                                           const CancellationToken& cancellation) {
  requireTemplateImage(image, camera);
  NPR_CUDA_CHECK(cudaSetDevice(device_));
  TemplateMatches found;
  auto begin = std::chrono::steady_clock::now();
  image_.upload(image.values, stream_);
  stream_.wait();  // the image need not outlive a call that is cancelled
  const TemplateLevels scanned =
      templateLevels(camera, distances, settings_.scanned_px, kScanStride);
  const TemplateLevels fitted = templateLevels(camera, distances, settings_.fitted_px, 1);
  respond(camera, scanned, kScanStride, &scanned_);
  scan(scanned, cancellation);
  for (std::size_t i = 0; i < distances.size(); ++i) {
    std::vector<TemplateHit> hits = hitsOf(i);
    keepBestHits(settings_, &hits);
    for (const TemplateHit& hit : hits) {
      TemplatePose pose = poseOf(hit, settings_, scanned.scales[i], static_cast<int>(i));
      pose.pixel = movedTo(fitted.scales[i].camera, scanned.scales[i].camera, pose.pixel);
      found.poses.push_back(pose);
    }
    found.lookups += scanLookups(*bank_, settings_, scanned.scales[i].camera);
  }
  found.scan_s = secondsSince(begin);

  cancellation.check();
  begin = std::chrono::steady_clock::now();
  respond(camera, fitted, 1, &fitted_);
  fit(fitted, &found.poses);
  for (TemplatePose& pose : found.poses) {
    const TemplateScale& scale = fitted.scales[static_cast<std::size_t>(pose.level)];
    pose.pixel = movedTo(camera, scale.camera, pose.pixel);
  }
  found.lookups += found.poses.size() * fitLookups(templates_.feature_count);
  found.fit_s = secondsSince(begin);
  return found;
}

}  // namespace nerf_pose_refiner
