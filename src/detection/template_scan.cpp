// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/template_scan.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "concurrency/parallel.h"
#include "image/resample.h"
#include "math/angle.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kTurn = 2 * kPi;
constexpr int kTileRows = 8;  // of positions, of which one may be a hit

/// The best position of a part of the image.
struct TilePeak {
  int score = -1, column = 0, row = 0;

  bool isBetterThan(const TilePeak& other) const {
    return std::tie(other.score, row, column) < std::tie(score, other.row, other.column);
  }
};

/// Positions of an image, from `left` and `top` on.
struct Block {
  int left, top, columns, rows;
};

/// Scans the positions of a level with all templates: block after block, whose responses then stay
/// in a core's cache for all of them.
class LevelScan {
 public:
  LevelScan(const TemplateLevel& level, const TemplateSet& templates, int count,
            const TemplateKernels& kernels)
      : level_(level),
        templates_(templates),
        count_(static_cast<std::size_t>(count)),
        kernels_(kernels),
        of_views_(templates.bank.views.size()) {
    for (std::size_t view = 0; view < of_views_.size(); ++view) {
      if (templates.bank.views[view].edges.empty()) continue;
      of_views_[view].resize(static_cast<std::size_t>(templates.rotations));
      for (int k = 0; k < templates.rotations; ++k) {
        Template& one = of_views_[view][static_cast<std::size_t>(k)];
        placeEdges(templates.turned(static_cast<int>(view), k), level.scale, 2, level.memory,
                   &one.offsets);
        one.peaks.resize(count_);
      }
    }
  }

  void run(int threads, const CancellationToken& cancellation) {
    const int stride = level_.memory.stride();
    const Camera& camera = level_.scale.camera;
    const int columns = (camera.width + stride - 1) / stride;
    const int rows = (camera.height + stride - 1) / stride;
    for (int top = 0; top < rows; top += kBlockRows) {
      for (int left = 0; left < columns; left += kScoreRun) {
        const Block block = {left, top, std::min(kScoreRun, columns - left),
                             std::min(kBlockRows, rows - top)};
        parallelFor(threads, static_cast<int>(of_views_.size()), [&](int view) {
          cancellation.check();
          for (Template& one : of_views_[static_cast<std::size_t>(view)]) scan(block, &one);
        });
      }
    }
  }

  /// Those of a view after those of the one before, of each rotation the best first.
  std::vector<TemplateHit> hits() const {
    std::vector<TemplateHit> hits;
    for (std::size_t view = 0; view < of_views_.size(); ++view) {
      for (std::size_t rotation = 0; rotation < of_views_[view].size(); ++rotation) {
        for (const TilePeak& peak : of_views_[view][rotation].peaks) {
          if (peak.score < 0) break;
          TemplateHit hit;
          hit.score = peak.score;
          hit.view = static_cast<int>(view);
          hit.rotation = static_cast<int>(rotation);
          hit.pixel = Eigen::Vector2d(peak.column, peak.row) * level_.memory.stride();
          hits.push_back(hit);
        }
      }
    }
    return hits;
  }

 private:
  static constexpr int kBlockRows = 8 * kTileRows;

  /// A view, turned in the image.
  struct Template {
    std::vector<std::int32_t> offsets;
    std::vector<TilePeak> peaks;  // so far, best first
  };

  void scan(const Block& block, Template* one) const {
    std::int16_t scores[kBlockRows * kScoreRun];
    kernels_.score(
        {level_.memory.place(block.left, block.top), level_.memory.columns(), block.rows, 1},
        {one->offsets.data(), static_cast<int>(one->offsets.size()) / kTemplateParts}, scores);
    for (int top = 0; top < block.rows; top += kTileRows) {
      TilePeak peak;
      for (int row = top; row < std::min(block.rows, top + kTileRows); ++row) {
        const std::int16_t* const here = scores + row * kScoreRun;
        std::int16_t most = 0;
        for (int column = 0; column < block.columns; ++column) most = std::max(most, here[column]);
        if (most <= peak.score) continue;
        const auto column = std::find(here, here + block.columns, most) - here;
        peak = {most, block.left + static_cast<int>(column), block.top + row};
      }
      keep(peak, &one->peaks);
    }
  }

  static void keep(const TilePeak& peak, std::vector<TilePeak>* best) {
    if (!peak.isBetterThan(best->back())) return;
    const auto place = std::find_if(best->begin(), best->end(), [&](const TilePeak& other) {
      return peak.isBetterThan(other);
    });
    std::move_backward(place, best->end() - 1, best->end());
    *place = peak;
  }

  const TemplateLevel& level_;
  const TemplateSet& templates_;
  std::size_t count_;
  const TemplateKernels& kernels_;
  std::vector<std::vector<Template>> of_views_;  // [view][rotation]
};

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
                                   const ScanWork& work, const CancellationToken& cancellation) {
  LevelScan scan(level, templates, work.hits_per_template, work.kernels);
  scan.run(work.threads, cancellation);
  return scan.hits();
}

double meanResponse(int score, int edges) {
  constexpr double kCounting = static_cast<double>(kTemplateParts - 1) / kTemplateParts;
  return score / (kCounting * edges * kMaxResponse);
}

}  // namespace nerf_pose_refiner
