// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/template_scan.h"

#include <algorithm>
#include <cmath>
#include <tuple>

#include "concurrency/parallel.h"

namespace nerf_pose_refiner {
namespace {

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
  LevelScan(const TemplateLevel& level, const TemplateSet& templates,
            const TemplateKernels& kernels)
      : level_(level),
        templates_(templates),
        kernels_(kernels),
        of_views_(templates.bank.views.size()) {}

  /// Threads share the views, some at a time, so that they rarely wait for each other.
  void run(int threads, const CancellationToken& cancellation) {
    constexpr int kSharesPerThread = 4;
    const int views = static_cast<int>(of_views_.size());
    const int shares = std::min(views, kSharesPerThread * threads);
    parallelFor(threads, shares, [&](int i) {
      const int first = views * i / shares, end = views * (i + 1) / shares;
      for (int view = first; view < end; ++view) place(view);
      scanViews(first, end, cancellation);
    });
  }

  /// Those of a view after those of the one before, of each rotation the best first.
  std::vector<TemplateHit> hits() const {
    std::vector<TemplateHit> hits;
    for (std::size_t view = 0; view < of_views_.size(); ++view) {
      for (std::size_t rotation = 0; rotation < of_views_[view].size(); ++rotation) {
        for (const TilePeak& peak : of_views_[view][rotation].peaks) {
          if (peak.score < 0) break;
          hits.push_back({peak.score, static_cast<int>(view), static_cast<int>(rotation),
                          peak.column, peak.row});
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

  /// In all rotations.
  void place(int number) {
    const TemplateMatchSettings& settings = templates_.settings;
    const TemplateView& view = templates_.bank.views[static_cast<std::size_t>(number)];
    if (view.features.empty()) return;
    std::vector<Template>& turned = of_views_[static_cast<std::size_t>(number)];
    turned.resize(static_cast<std::size_t>(settings.rotations));
    for (int k = 0; k < settings.rotations; ++k) {
      Template& one = turned[static_cast<std::size_t>(k)];
      placeFeatures(view,
                    TemplatePlacement::of(rotationOf(settings, k), level_.scale.camera.fx,
                                          level_.scale.distance()),
                    kScanFeatureStep, level_.memory.order(), &one.offsets);
      one.peaks.resize(static_cast<std::size_t>(settings.hits_per_template));
    }
  }

  void scanViews(int first, int end, const CancellationToken& cancellation) {
    const Camera& camera = level_.scale.camera;
    const int columns = (camera.width + kScanStride - 1) / kScanStride;
    const int rows = (camera.height + kScanStride - 1) / kScanStride;
    for (int top = 0; top < rows; top += kBlockRows) {
      for (int left = 0; left < columns; left += kScoreRun) {
        cancellation.check();
        const Block block = {left, top, std::min(kScoreRun, columns - left),
                             std::min(kBlockRows, rows - top)};
        for (int view = first; view < end; ++view) {
          for (Template& one : of_views_[static_cast<std::size_t>(view)]) scan(block, &one);
        }
      }
    }
  }

  void scan(const Block& block, Template* one) const {
    std::int16_t scores[kBlockRows * kScoreRun];
    kernels_.score(
        {level_.memory.place(block.left, block.top), level_.memory.order().columns, block.rows, 1},
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
  const TemplateKernels& kernels_;
  std::vector<std::vector<Template>> of_views_;  // [view][rotation]
};

}  // namespace

void placeFeatures(const TemplateView& view, const TemplatePlacement& placement, int step,
                   const ResponseOrder& order, std::vector<std::int32_t>* offsets) {
  offsets->clear();
  for (std::size_t i = 0; i < view.features.size(); i += static_cast<std::size_t>(step)) {
    const TemplateFeature& feature = view.features[i];
    offsets->push_back(order.offsetOf(placeFeature(
        placement, {feature.point.x(), feature.point.y(), feature.point.z()}, feature.normal_rad)));
  }
}

std::vector<TemplateHit> scanLevel(const TemplateLevel& level, const TemplateSet& templates,
                                   const ScanWork& work, const CancellationToken& cancellation) {
  LevelScan scan(level, templates, work.kernels);
  scan.run(work.threads, cancellation);
  return scan.hits();
}

}  // namespace nerf_pose_refiner
