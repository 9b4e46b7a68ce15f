// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/keyframe_level.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>
#include <vector>

#include "backend/common/box_sums.h"
#include "backend/common/image_levels.h"
#include "concurrency/parallel.h"
#include "math/keyframe_alignment.h"
#include "math/tile_scatter.h"
#include "views/outline.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kCellSide = 8;    // points are distributed evenly over cells of this size [px]
constexpr int kLeastRows = 32;  // of a thread

// A pixel that may be chosen as a point.
struct Candidate {
  int pixel = 0;
  float information = 0;
};

bool isBetter(const Candidate& a, const Candidate& b) {
  return a.information != b.information ? a.information > b.information : a.pixel < b.pixel;
}

class LevelMaker {
 public:
  LevelMaker(const Image& layers, const KeyframeView& view, const KeyframeSettings& settings,
             int threads)
      : layers_(layers), view_(view), settings_(settings), threads_(threads) {
    smoothImage(layers, &smooth_, threads);
    width_ = layers.width;
    height_ = layers.height;
  }

  KeyframeLevel make(int window) {
    findShown();
    layGrid(window);
    normaliseColours();
    fillShown();
    fillChosen(choose());
    fillOutline();
    return std::move(level_);
  }

 private:
  /// body(first row, end).
  template <typename Body>
  void forRows(const Body& body) const {
    parallelBands(threads_, height_, kLeastRows, body);
  }

  Eigen::Vector3f pointAt(int x, int y) const {
    const float* pixel = smooth_.pixel(x, y);
    return Eigen::Map<const Eigen::Vector3f>(pixel + kKeyframePoint) / pixel[kKeyframeAlpha];
  }

  // Depths before smoothing; not finite where there is nothing.
  std::vector<float> depths() const {
    std::vector<float> depths(layers_.pixels());
    forRows([&](int first, int end) {
      const std::size_t after = static_cast<std::size_t>(end) * width_;
      for (std::size_t i = static_cast<std::size_t>(first) * width_; i < after; ++i) {
        const float* pixel = layers_.values.data() + kKeyframeChannels * i;
        const Eigen::Vector3f point =
            Eigen::Map<const Eigen::Vector3f>(pixel + kKeyframePoint) / pixel[kKeyframeAlpha];
        depths[i] = view_.forward.dot(point) + view_.centre.z();
      }
    });
    return depths;
  }

  bool isOpaque(int x, int y) const {
    return std::min(layers_.at(x, y, kKeyframeAlpha), smooth_.at(x, y, kKeyframeAlpha)) >
           settings_.min_alpha;
  }

  // Smoothing mixes a pixel with its direct neighbours.
  bool isAtDepthJump(const std::vector<float>& depths, int x, int y) const {
    const float depth = depths[y * width_ + x];
    const float step = settings_.max_depth_step * depth / view_.focal_px.x();
    for (int v = std::max(0, y - 1); v <= std::min(height_ - 1, y + 1); ++v) {
      for (int u = std::max(0, x - 1); u <= std::min(width_ - 1, x + 1); ++u) {
        if (std::abs(depths[v * width_ + u] - depth) > step) return true;
      }
    }
    return false;
  }

  void findShown() {
    shown_.assign(smooth_.pixels(), 0);
    const std::vector<float> depth = depths();
    forRows([&](int first, int end) {
      for (int y = first; y < end; ++y) {
        for (int x = 0; x < width_; ++x) {
          shown_[y * width_ + x] = isOpaque(x, y) && !isAtDepthJump(depth, x, y);
        }
      }
    });
  }

  void layGrid(int window) {
    const auto shown = std::count(shown_.begin(), shown_.end(), 1);
    while (shown >
           static_cast<std::ptrdiff_t>(level_.spacing) * level_.spacing * settings_.max_shown) {
      ++level_.spacing;
    }
    level_.width = (width_ + level_.spacing - 1) / level_.spacing;
    level_.height = (height_ + level_.spacing - 1) / level_.spacing;
    level_.window = std::max(1, window / level_.spacing);
  }

  int pixelOfCell(int cell) const {
    return cell / level_.width * level_.spacing * width_ + cell % level_.width * level_.spacing;
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

  // Normalises colours by their surroundings, as alignment does with those of the image.
  void normaliseColours() {
    const int cells = level_.width * level_.height;
    std::vector<float> colours(static_cast<std::size_t>(kBoxChannels) * cells, 0.0f);
    std::vector<float> counts = colours, sums;
    for (int cell = 0; cell < cells; ++cell) {
      if (!shown_[pixelOfCell(cell)]) continue;
      const Eigen::Vector3f colour = colourAt(pixelOfCell(cell));
      float* const values = colours.data() + static_cast<std::ptrdiff_t>(kBoxChannels) * cell;
      for (int c = 0; c < 3; ++c) {
        values[c] = colour[c];
        values[3 + c] = colour[c] * colour[c];
      }
      counts[static_cast<std::size_t>(kBoxChannels) * cell] = 1;
    }
    boxSums(counts, level_.width, level_.height, level_.window, &sums);
    std::vector<float> inverse_count(cells, 0.0f);
    for (int cell = 0; cell < cells; ++cell) {
      const float count = std::round(sums[static_cast<std::size_t>(kBoxChannels) * cell]);
      if (count > 0) inverse_count[cell] = 1 / count;
    }
    boxSums(colours, level_.width, level_.height, level_.window, &sums);
    local_.resize(cells);
    for (std::size_t cell = 0; cell < inverse_count.size(); ++cell) {
      if (inverse_count[cell] == 0) continue;
      local_[cell] = localColours(sums.data() + kBoxChannels * cell, inverse_count[cell]);
    }
    normalisePixels(inverse_count);
  }

  void normalisePixels(const std::vector<float>& inverse_count) {
    normalised_ = Image(width_, height_, 3);
    forRows([&](int first, int end) {
      for (int y = first; y < end; ++y) normaliseRow(inverse_count, y);
    });
  }

  void normaliseRow(const std::vector<float>& inverse_count, int y) {
    const int row = y / level_.spacing * level_.width;
    for (int x = 0, pixel = y * width_; x < width_; ++x, ++pixel) {
      if (!shown_[pixel]) continue;
      const int cell = row + x / level_.spacing;
      if (inverse_count[cell] == 0) {  // no neighbour to compare it with
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

  void addShown(int pixel, int cell) {
    addPoint(pixel, cell, &level_.shown);
    const Eigen::Vector3f colour = colourAt(pixel);
    for (int c = 0; c < 3; ++c) level_.shown_colour[c].push_back(colour[c]);
  }

  void fillShown() {
    const PointColumns& shown = level_.shown;
    const int none = level_.width * level_.height;
    int last = 0;
    for (int cell = 0; cell < none; ++cell) {
      if (!shown_[pixelOfCell(cell)]) continue;
      last = pixelOfCell(cell);
      addShown(last, cell);
    }
    while (shown.size() % kPointGroup != 0) addShown(last, none);
  }

  // What a pixel says of the pose: the squared gradient of its colours. 0 where a neighbour is not
  // known.
  float informationAt(int x, int y) const {
    if (x == 0 || y == 0 || x + 1 == width_ || y + 1 == height_) return 0;
    const char* const shown = shown_.data() + y * width_ + x;
    if (!shown[0] || !shown[-1] || !shown[1] || !shown[-width_] || !shown[width_]) return 0;
    const float* const here = normalised_.pixel(x, y);
    const int right = 3, down = 3 * width_;
    float sum = 0;
    for (int c = 0; c < 3; ++c) {
      const float du = here[c + right] - here[c - right];
      const float dv = here[c + down] - here[c - down];
      sum += du * du + dv * dv;
    }
    return sum;
  }

  // The pixels of a cell that say something.
  std::vector<Candidate> candidatesOf(int cell_x, int cell_y) const {
    std::vector<Candidate> candidates;
    for (int y = cell_y; y < std::min(cell_y + kCellSide, height_); ++y) {
      for (int x = cell_x; x < std::min(cell_x + kCellSide, width_); ++x) {
        const float information = informationAt(x, y);
        if (information > 0) candidates.push_back({y * width_ + x, information});
      }
    }
    return candidates;
  }

  // Those of every cell that has any, row by row.
  std::vector<std::vector<Candidate>> candidates() const {
    const int across = (width_ + kCellSide - 1) / kCellSide;
    const int down = (height_ + kCellSide - 1) / kCellSide;
    std::vector<std::vector<Candidate>> cells(static_cast<std::size_t>(across) * down);
    parallelBands(threads_, down, kLeastRows / kCellSide, [&](int first, int end) {
      for (int i = first * across; i < end * across; ++i) {
        cells[i] = candidatesOf(i % across * kCellSide, i / across * kCellSide);
      }
    });
    withoutEmpty(&cells);
    return cells;
  }

  static void withoutEmpty(std::vector<std::vector<Candidate>>* cells) {
    cells->erase(std::remove_if(cells->begin(), cells->end(),
                                [](const std::vector<Candidate>& cell) { return cell.empty(); }),
                 cells->end());
  }

  // The best of every cell first, then the second best, until there are enough.
  std::vector<Candidate> choose() const {
    std::vector<std::vector<Candidate>> cells = candidates();
    const auto enough = static_cast<std::size_t>(settings_.max_points);
    std::vector<Candidate> chosen;
    while (!cells.empty() && chosen.size() < enough) {
      std::vector<Candidate> next = takeBest(&cells);
      std::sort(next.begin(), next.end(), isBetter);
      next.resize(std::min(next.size(), enough - chosen.size()));
      chosen.insert(chosen.end(), next.begin(), next.end());
    }
    return chosen;
  }

  // Moves the best candidate out of every cell; cells that are empty then are left out.
  // (Few ranks are needed, so cells are not sorted.)
  static std::vector<Candidate> takeBest(std::vector<std::vector<Candidate>>* cells) {
    std::vector<Candidate> best;
    for (std::vector<Candidate>& cell : *cells) {
      std::iter_swap(std::min_element(cell.begin(), cell.end(), isBetter), std::prev(cell.end()));
      best.push_back(cell.back());
      cell.pop_back();
    }
    withoutEmpty(cells);
    return best;
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

  void addChosen(int pixel, float weight) {
    addPoint(pixel, cellOfPixel(pixel), &level_.chosen);
    level_.surface.push_back(surfaceAt(pixel % width_, pixel / width_));
    level_.weight.push_back(weight);
    const LocalColours<float>& local = local_[cellOfPixel(pixel)];
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
  void fillChosen(const std::vector<Candidate>& chosen) {
    std::vector<std::pair<int, int>> places;  // tile and pixel
    places.reserve(chosen.size());
    for (const Candidate& one : chosen) places.emplace_back(tileOf(one.pixel), one.pixel);
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

  // The more information the interior has, the less the outline counts: the model's outline may be
  // wrong by a fraction of a pixel, and the background may look like the object.
  float outlineWeight() const {
    constexpr float kMin = 0.2f, kMax = 4, kEnough = 60;
    float information = 0;
    for (const ChosenSurface& surface : level_.surface) {
      for (const Eigen::Vector2f& gradient : surface.gradient)
        information += gradient.squaredNorm();
    }
    const float missing = std::min(1.0f, kEnough / std::max(information, 1.0f));
    return kMin + (kMax - kMin) * missing * missing;
  }

  void fillOutline() {
    level_.outline_weight = outlineWeight();
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
  const KeyframeSettings& settings_;
  const int threads_;
  int width_, height_;  // of the keyframe's own pixels
  Image smooth_;
  std::vector<char> shown_;
  std::vector<LocalColours<float>> local_;  // of the grid's cells
  Image normalised_;                        // [h][w][3], 0 where the object is not shown
  KeyframeLevel level_;
};

}  // namespace

KeyframeLevel makeLevel(const Image& layers, const KeyframeView& view, int window,
                        const KeyframeSettings& settings, int threads) {
  return LevelMaker(layers, view, settings, threads).make(window);
}

}  // namespace nerf_pose_refiner
