// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/keyframe_level.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "backend/common/box_sums.h"
#include "backend/common/image_levels.h"
#include "concurrency/parallel.h"
#include "math/keyframe_alignment.h"
#include "math/tile_scatter.h"
#include "views/chosen_points.h"
#include "views/depth_range.h"
#include "views/outline.h"

namespace nerf_pose_refiner {
namespace {

/// Of colours around a point, over all channels, at which it counts half.
constexpr float kPlainDeviation = 0.1f;

constexpr int kBandRows = 2 * kChoiceCell;  // whole cells

/// Makes a level in stages. The parts of a stage do not touch each other; each stage needs all of
/// the one before.
class LevelMaker {
 public:
  enum Stage { kShown, kLocalColours, kNormalised, kPoints, kChosen, kStages };

  LevelMaker(const LevelSource& source, const KeyframeSettings& settings)
      : layers_(source.layers),
        view_(source.view),
        window_(source.window),
        holds_distance_(source.holds_distance),
        settings_(settings),
        width_(layers_.width),
        height_(layers_.height),
        smooth_(width_, height_, kKeyframeChannels),
        shown_(layers_.pixels()),
        normalised_(width_, height_, 3),
        candidates_(bands()) {}

  int partsOf(int stage) const {
    const int parts[kStages] = {bands(), 1, bands(), 2 + bands(), 1};
    return parts[stage];
  }

  void make(int stage, int part) {
    switch (stage) {
      case kShown:
        smoothRows(layers_, firstRow(part), lastRow(part), &smooth_);
        findShown(firstRow(part), lastRow(part));
        break;
      case kLocalColours:
        layGrid();
        findLocalColours();
        break;
      case kNormalised:
        for (int y = firstRow(part); y < lastRow(part); ++y) normaliseRow(y);
        break;
      case kPoints:
        findPoints(part);
        break;
      case kChosen:
        fillChosen(choosePoints(std::move(candidates_), settings_.max_points));
        weighOutline();
        break;
      default:
        break;
    }
  }

  KeyframeLevel take() { return std::move(level_); }

 private:
  int bands() const { return (height_ + kBandRows - 1) / kBandRows; }
  static int firstRow(int band) { return band * kBandRows; }
  int lastRow(int band) const { return std::min(height_, firstRow(band + 1)); }

  Eigen::Vector3f pointAt(int x, int y) const {
    const float* pixel = smooth_.pixel(x, y);
    return Eigen::Map<const Eigen::Vector3f>(pixel + kKeyframePoint) / pixel[kKeyframeAlpha];
  }

  // Those that take longest come first.
  void findPoints(int part) {
    if (part == 0) {
      fillOutline();
    } else if (part == 1) {
      fillShown();
    } else {
      const int band = part - 2;
      candidates_[band] = candidatesIn(normalised_, shown_, firstRow(band), lastRow(band));
    }
  }

  // Depths of rows before smoothing; not finite where there is nothing.
  std::vector<float> depthsOf(int first, int last) const {
    std::vector<float> depths(static_cast<std::size_t>(last - first) * width_);
    const float* pixel = layers_.pixel(0, first);
    for (float& depth : depths) {
      const Eigen::Vector3f point =
          Eigen::Map<const Eigen::Vector3f>(pixel + kKeyframePoint) / pixel[kKeyframeAlpha];
      depth = view_.forward.dot(point) + view_.centre.z();
      pixel += kKeyframeChannels;
    }
    return depths;
  }

  bool isOpaque(int x, int y) const {
    return std::min(layers_.at(x, y, kKeyframeAlpha), smooth_.at(x, y, kKeyframeAlpha)) >
           settings_.min_alpha;
  }

  // Smoothing mixes a pixel with its direct neighbours.
  bool isAtDepthJump(const DepthRange& around, float depth, int x) const {
    const float step = settings_.max_depth_step * depth / view_.focal_px.x();
    return around.farthest(x) - depth > step || depth - around.nearest(x) > step;
  }

  void findShown(int first, int last) {
    const int above = std::max(0, first - 1), below = std::min(height_, last + 1);
    const std::vector<float> depths = depthsOf(above, below);
    DepthRange around(width_);
    for (int y = first; y < last; ++y) {
      around.take(depths, below - above, y - above);
      const float* const depth = depths.data() + static_cast<std::ptrdiff_t>(y - above) * width_;
      for (int x = 0; x < width_; ++x) {
        shown_[y * width_ + x] = isOpaque(x, y) && !isAtDepthJump(around, depth[x], x);
      }
    }
  }

  void layGrid() {
    const auto shown = std::count(shown_.begin(), shown_.end(), 1);
    while (shown >
           static_cast<std::ptrdiff_t>(level_.spacing) * level_.spacing * settings_.max_shown) {
      ++level_.spacing;
    }
    level_.width = (width_ + level_.spacing - 1) / level_.spacing;
    level_.height = (height_ + level_.spacing - 1) / level_.spacing;
    level_.window = std::max(1, window_ / level_.spacing);
  }

  /// body(cell, its pixel) for those of the grid's cells whose pixel is shown, row by row.
  template <typename Body>
  void forShownCells(const Body& body) const {
    for (int y = 0, cell = 0; y < level_.height; ++y) {
      int pixel = y * level_.spacing * width_;
      for (int x = 0; x < level_.width; ++x, ++cell, pixel += level_.spacing) {
        if (shown_[pixel]) body(cell, pixel);
      }
    }
  }

  // Of the grid.
  int cellOfPixel(int pixel) const {
    return pixel / width_ / level_.spacing * level_.width + pixel % width_ / level_.spacing;
  }

  Eigen::Vector3f colourAt(int pixel) const {
    const float* layers =
        smooth_.values.data() + static_cast<std::size_t>(kKeyframeChannels) * pixel;
    return Eigen::Map<const Eigen::Vector3f>(layers) / layers[kKeyframeAlpha];
  }

  // By which colours are normalised, as alignment does with those of the image.
  void findLocalColours() {
    const int cells = level_.width * level_.height;
    constexpr int kCount = 6;  // the channel after colours and their squares
    std::vector<float> colours(static_cast<std::size_t>(kBoxChannels) * cells, 0.0f), sums;
    forShownCells([&](int cell, int pixel) {
      const Eigen::Vector3f colour = colourAt(pixel);
      float* const values = colours.data() + static_cast<std::ptrdiff_t>(kBoxChannels) * cell;
      for (int c = 0; c < 3; ++c) {
        values[c] = colour[c];
        values[3 + c] = colour[c] * colour[c];
      }
      values[kCount] = 1;
    });
    boxSums(colours, level_.width, level_.height, level_.window, &sums);
    has_neighbours_.resize(cells);
    local_.resize(cells);
    for (int cell = 0; cell < cells; ++cell) {
      const float* const sum = sums.data() + static_cast<std::ptrdiff_t>(kBoxChannels) * cell;
      if (sum[kCount] < 0.5f) continue;
      has_neighbours_[cell] = 1;
      local_[cell] = localColours(sum, 1 / std::round(sum[kCount]));
    }
  }

  void normaliseRow(int y) {
    const int row = y / level_.spacing * level_.width;
    for (int x = 0, pixel = y * width_; x < width_; ++x, ++pixel) {
      if (!shown_[pixel]) continue;
      const int cell = row + x / level_.spacing;
      if (!has_neighbours_[cell]) {  // nothing to compare it with
        shown_[pixel] = 0;
        continue;
      }
      const LocalColours<float>& local = local_[cell];
      const Eigen::Vector3f colour = colourAt(pixel);
      float* const normalised = normalised_.pixel(x, y);
      for (int c = 0; c < 3; ++c) {
        normalised[c] = (colour[c] - local.mean[c]) * local.inverse_deviation[c];
      }
    }
  }

  void addPoint(int pixel, int cell, PointColumns* points) const {
    const Eigen::Vector3f p = pointAt(pixel % width_, pixel / width_);
    points->x.push_back(p.x());
    points->y.push_back(p.y());
    points->z.push_back(p.z());
    points->cell.push_back(cell);
  }

  // By the neighbours that are shown: a silhouette's are on one side.
  Vec3<float> normalAt(int x, int y) const {
    const auto isShown = [this](int u, int v) {
      return u >= 0 && v >= 0 && u < width_ && v < height_ && shown_[v * width_ + u];
    };
    const auto step = [&](int du, int dv) {
      const int before = isShown(x - du, y - dv) ? 1 : 0, behind = isShown(x + du, y + dv) ? 1 : 0;
      const Eigen::Vector3f along =
          pointAt(x + behind * du, y + behind * dv) - pointAt(x - before * du, y - before * dv);
      return Vec3<float>{along.x(), along.y(), along.z()};
    };
    const Vec3<float> tangent[2] = {step(1, 0), step(0, 1)};
    return surfaceNormal(tangent);
  }

  void addShown(int pixel, int cell) {
    addPoint(pixel, cell, &level_.shown);
    const Eigen::Vector3f colour = colourAt(pixel);
    for (int c = 0; c < 3; ++c) level_.shown_colour[c].push_back(colour[c]);
    level_.shown_normal.push_back(normalAt(pixel % width_, pixel / width_));
  }

  void fillShown() {
    const PointColumns& shown = level_.shown;
    const int none = level_.width * level_.height;
    int last = 0;
    forShownCells([&](int cell, int pixel) {
      last = pixel;
      addShown(pixel, cell);
    });
    const int count = shown.size();
    for (int i = 0; i < count; i += (count - 1) / kMaxLightSamples + 1) {
      level_.light_samples.push_back(i);
    }
    while (shown.size() % kPointGroup != 0) addShown(last, none);
  }

  int tileOf(int pixel) const { return tileOfPixel(pixel, width_); }

  ChosenSurface surfaceAt(int x, int y) const {
    ChosenSurface surface;
    surface.tangent[0] = 0.5f * (pointAt(x + 1, y) - pointAt(x - 1, y));
    surface.tangent[1] = 0.5f * (pointAt(x, y + 1) - pointAt(x, y - 1));
    for (int c = 0; c < 3; ++c) {
      surface.gradient[c] = {0.5f * (normalised_.at(x + 1, y, c) - normalised_.at(x - 1, y, c)),
                             0.5f * (normalised_.at(x, y + 1, c) - normalised_.at(x, y - 1, c))};
    }
    return surface;
  }

  // What a point says by its surroundings' colours: the shading of a plain surface turns with the
  // light, and the noise of a model is as large.
  static float weightAmong(const LocalColours<float>& local) {
    float variance = 0;
    for (const float inverse : local.inverse_deviation) {
      variance += 1 / (inverse * inverse) - kFlatDeviation * kFlatDeviation;
    }
    constexpr float kLeast = 0.02f;  // it tells at least that it is in the image
    return std::max(kLeast, variance / (variance + kPlainDeviation * kPlainDeviation));
  }

  void addChosen(int pixel, float weight) {
    addPoint(pixel, cellOfPixel(pixel), &level_.chosen);
    level_.surface.push_back(surfaceAt(pixel % width_, pixel / width_));
    const LocalColours<float>& local = local_[cellOfPixel(pixel)];
    level_.weight.push_back(weight * weightAmong(local));
    for (int c = 0; c < 3; ++c) {
      level_.colour[c].push_back(normalised_.values[3 * static_cast<std::size_t>(pixel) + c]);
      level_.local.mean[c].push_back(local.mean[c]);
      level_.local.inverse_deviation[c].push_back(local.inverse_deviation[c]);
    }
  }

  void fillGroup(int pixel) {
    while (level_.chosen.size() % kPointGroup != 0) addChosen(pixel, 0);
  }

  // Tile by tile.
  void fillChosen(const std::vector<int>& chosen) {
    std::vector<std::pair<int, int>> places;  // tile and pixel
    places.reserve(chosen.size());
    for (const int pixel : chosen) places.emplace_back(tileOf(pixel), pixel);
    std::sort(places.begin(), places.end());
    level_.point_count = static_cast<int>(places.size());
    level_.tiles = {0};
    for (std::size_t i = 0; i < places.size(); ++i) {
      const auto [tile, pixel] = places[i];
      addChosen(pixel, 1);
      if (i + 1 == places.size() || places[i + 1].first != tile) {
        fillGroup(pixel);
        level_.tiles.push_back(level_.chosen.size());
      }
    }
  }

  // The more information the interior has, the less the outline counts, from 1 to 0.
  float outlineShare() const {
    constexpr float kEnough = 60;
    float information = 0;
    for (std::size_t i = 0; i < level_.surface.size(); ++i) {
      for (const Eigen::Vector2f& gradient : level_.surface[i].gradient)
        information += level_.weight[i] * gradient.squaredNorm();
    }
    const float missing = std::min(1.0f, kEnough / std::max(information, 1.0f));
    return missing * missing;
  }

  void weighOutline() {
    // In other light shading takes the interior along, so in the end the outline says more of the
    // distance. But clutter holds outlines, and many poses have alike ones: from afar it is worth
    // less, and as evidence beside a surface that says something, @see keyframeScore.
    const float share = outlineShare();
    level_.outline_evidence = 0.2f + 3.8f * share;
    level_.outline_weight = holds_distance_ ? 2 + 6 * share : level_.outline_evidence;
  }

  void fillOutline() {
    level_.outline_tiles = {0};
    int tile = -1;
    for (const OutlinePlace& place : outlineOf(smooth_, view_, settings_.max_outline)) {
      const int of_place = tileOf(place.pixel);
      if (tile >= 0 && of_place != tile) {
        level_.outline_tiles.push_back(static_cast<std::int32_t>(level_.outline.size()));
      }
      tile = of_place;
      level_.outline.push_back(place.point);
    }
    level_.outline_tiles.push_back(static_cast<std::int32_t>(level_.outline.size()));
  }

  const Image& layers_;
  const KeyframeView& view_;
  int window_;
  bool holds_distance_;
  const KeyframeSettings& settings_;
  int width_, height_;  // of the keyframe's own pixels
  Image smooth_;
  std::vector<char> shown_;
  std::vector<LocalColours<float>> local_;  // of the grid's cells
  std::vector<char> has_neighbours_;        // of the grid's cells: whether there are such colours
  Image normalised_;                        // [h][w][3], 0 where the object is not shown
  std::vector<CellCandidates> candidates_;  // of the bands
  KeyframeLevel level_;
};

}  // namespace

std::vector<KeyframeLevel> makeLevels(const std::vector<LevelSource>& sources,
                                      const KeyframeSettings& settings, int threads) {
  std::vector<LevelMaker> makers;
  makers.reserve(sources.size());
  for (const LevelSource& source : sources) makers.emplace_back(source, settings);
  for (int stage = 0; stage < LevelMaker::kStages; ++stage) {
    parallelForParts(
        threads, static_cast<int>(makers.size()), [&](int i) { return makers[i].partsOf(stage); },
        [&](int i, int part) { makers[i].make(stage, part); });
  }
  std::vector<KeyframeLevel> levels;
  levels.reserve(makers.size());
  for (LevelMaker& maker : makers) levels.push_back(maker.take());
  return levels;
}

}  // namespace nerf_pose_refiner
