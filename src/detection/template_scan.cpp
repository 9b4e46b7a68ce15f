// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/template_scan.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "image/resample.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kTurn = 2 * 3.14159265358979323846;
constexpr int kTileRows = 8;  // of positions, of which one may be a hit

/// Scores of the positions in an image.
struct ScoreMap {
  int columns, rows;
  int row_length;  // whole runs
  std::vector<std::int16_t> scores;
};

/// The best position of a part of the image.
struct TilePeak {
  int score, column, row;
};

TilePeak peakOf(const ScoreMap& map, int left, int top) {
  TilePeak peak = {-1, left, top};
  const int right = std::min(map.columns, left + kScoreRun);
  for (int row = top; row < std::min(map.rows, top + kTileRows); ++row) {
    const std::int16_t* const scores =
        map.scores.data() + static_cast<std::ptrdiff_t>(row) * map.row_length;
    std::int16_t most = 0;
    for (int column = left; column < right; ++column) most = std::max(most, scores[column]);
    if (most <= peak.score) continue;
    const auto place = std::find(scores + left, scores + right, most);
    peak = {most, static_cast<int>(place - scores), row};
  }
  return peak;
}

std::vector<TilePeak> bestPeaks(const ScoreMap& map, int count) {
  std::vector<TilePeak> peaks;
  for (int top = 0; top < map.rows; top += kTileRows) {
    for (int left = 0; left < map.columns; left += kScoreRun) {
      peaks.push_back(peakOf(map, left, top));
    }
  }
  const auto most = std::min<std::ptrdiff_t>(count, static_cast<std::ptrdiff_t>(peaks.size()));
  std::partial_sort(
      peaks.begin(), peaks.begin() + most, peaks.end(), [](const TilePeak& a, const TilePeak& b) {
        return std::tie(b.score, a.row, a.column) < std::tie(a.score, b.row, b.column);
      });
  peaks.resize(static_cast<std::size_t>(most));
  return peaks;
}

/// How far edges may be from the object's centre, a multiple of the stride [px].
int marginOf(const TemplateScale& scale, int stride) {
  constexpr double kRadius = 0.6, kNearer = 0.4, kNearest = 0.6;  // [diameters]
  const double distance = scale.distance();
  const double nearer = std::max(kNearest, distance - kNearer);
  const double reach = kRadius * scale.object_px * distance / nearer;
  return stride * static_cast<int>(std::ceil(reach / stride));
}

}  // namespace

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

TemplateLevel makeTemplateLevel(const Image& image, const Camera& camera,
                                const TemplateScale& wanted, int stride) {
  return {wanted, ResponseMemory(orientationResponses(resample(image, camera, wanted.camera)),
                                 stride, marginOf(wanted, stride))};
}

TurnedView TemplateSet::turned(int view, int rotation) const {
  return {&bank.views[static_cast<std::size_t>(view)], kTurn * rotation / rotations};
}

std::vector<TemplateHit> scanLevel(const TemplateLevel& level, const TemplateSet& templates,
                                   int view, int count, const TemplateKernels& kernels) {
  std::vector<TemplateHit> hits;
  if (templates.bank.views[static_cast<std::size_t>(view)].edges.empty()) return hits;
  const int stride = level.memory.stride();
  const Camera& camera = level.scale.camera;
  ScoreMap map;
  map.columns = (camera.width + stride - 1) / stride;
  map.rows = (camera.height + stride - 1) / stride;
  const int runs = (map.columns + kScoreRun - 1) / kScoreRun;
  map.row_length = runs * kScoreRun;
  map.scores.resize(static_cast<std::size_t>(map.rows) * map.row_length);
  std::vector<std::int32_t> offsets;
  for (int rotation = 0; rotation < templates.rotations; ++rotation) {
    placeEdges(templates.turned(view, rotation), level.scale, 2, level.memory, &offsets);
    kernels.score({level.memory.place(0, 0), level.memory.columns(), map.rows, runs},
                  {offsets.data(), static_cast<int>(offsets.size()) / kTemplateParts},
                  map.scores.data());
    for (const TilePeak& peak : bestPeaks(map, count)) {
      TemplateHit hit;
      hit.score = peak.score;
      hit.view = view;
      hit.rotation = rotation;
      hit.pixel = Eigen::Vector2d(peak.column, peak.row) * stride;
      hits.push_back(hit);
    }
  }
  return hits;
}

double meanResponse(int score, int edges) {
  constexpr double kCounting = static_cast<double>(kTemplateParts - 1) / kTemplateParts;
  return score / (kCounting * edges * kMaxResponse);
}

}  // namespace nerf_pose_refiner
