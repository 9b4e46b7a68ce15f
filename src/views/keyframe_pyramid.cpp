// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/keyframe_pyramid.h"

#include <Eigen/Core>

#include <algorithm>
#include <cstddef>
#include <utility>

#include "backend/common/image_levels.h"
#include "concurrency/parallel.h"

namespace nerf_pose_refiner {
namespace {

/// A rectangle of whole pixels.
struct PixelBox {
  int left, top, width, height;
};

// The part of a rendering that shows the object, in whole steps. One more on each side, because the
// outline is compared with its outside.
PixelBox shownPart(const Image& alpha, int step) {
  int left = alpha.width, right = 0, top = alpha.height, bottom = 0;
  for (int y = 0; y < alpha.height; ++y) {
    for (int x = 0; x < alpha.width; ++x) {
      if (alpha.at(x, y, 0) < 0.5f) continue;
      left = std::min(left, x);
      right = std::max(right, x + 1);
      top = std::min(top, y);
      bottom = std::max(bottom, y + 1);
    }
  }
  left = std::max(0, std::min(left, right) / step * step - step);
  top = std::max(0, std::min(top, bottom) / step * step - step);
  return {left, top, std::min((right - left + step - 1) / step * step + step, alpha.width - left),
          std::min((bottom - top + step - 1) / step * step + step, alpha.height - top)};
}

// As cameras and OpenCV make grey of encoded colours (ITU-R BT.601).
void makeGrey(Image* layers) {
  for (std::size_t i = 0; i < layers->pixels(); ++i) {
    float* pixel = layers->values.data() + kKeyframeChannels * i;
    std::fill_n(pixel, 3, 0.299f * pixel[0] + 0.587f * pixel[1] + 0.114f * pixel[2]);
  }
}

class PyramidMaker {
 public:
  PyramidMaker(const RenderedWindow& window, const Eigen::Vector3d& centre,
               const KeyframeSettings& settings)
      : rendering_(window.rendering),
        rays_(rendering_.alpha.width / window.camera.width),
        coarsest_(settings.levels - 1),
        centre_(centre.cast<float>()),
        grey_(settings.grey),
        part_(shownPart(rendering_.alpha, rays_ << coarsest_)) {
    for (int level = 0; level <= coarsest_; ++level) {
      const int side = rays_ << level;  // of a pixel, in the rendering
      pyramid_.emplace_back(part_.width / side, part_.height / side, kKeyframeChannels);
    }
  }

  int coarsestRows() const { return pyramid_.back().height; }

  /// Fills a row of the coarsest level and what it shows in the others.
  void fillRow(int row) {
    const int below = rays_ << coarsest_;
    Image layers = layersOf(row * below, below), half;
    if (grey_) makeGrey(&layers);
    for (int n = rays_; n > 1; n /= 2) {
      halveImage(layers, &half);
      std::swap(layers, half);
    }
    std::copy(layers.values.begin(), layers.values.end(), pyramid_[0].pixel(0, row << coarsest_));
    for (int level = 1; level <= coarsest_; ++level) {
      const int rows = 1 << (coarsest_ - level);
      for (int y = row * rows; y < (row + 1) * rows; ++y) halveInto(level, y);
    }
  }

  KeyframePyramid take() { return std::move(pyramid_); }

 private:
  /// Rows of the shown part of the rendering.
  Image layersOf(int first_row, int rows) const {
    Image layers(part_.width, rows, kKeyframeChannels);
    for (int y = 0; y < rows; ++y) {
      const int in_rendering = part_.top + first_row + y;
      const float* alpha = rendering_.alpha.pixel(part_.left, in_rendering);
      const float* colour = rendering_.colour.pixel(part_.left, in_rendering);
      const float* point = rendering_.point.pixel(part_.left, in_rendering);
      float* pixel = layers.pixel(0, y);
      for (int x = 0; x < part_.width; ++x, ++alpha, colour += 3, point += 3) {
        for (std::size_t c = 0; c < 3; ++c) {
          pixel[c] = colour[c];
          pixel[kKeyframePoint + c] = point[c] - *alpha * centre_[c];
        }
        pixel[kKeyframeAlpha] = *alpha;
        pixel += kKeyframeChannels;
      }
    }
    return layers;
  }

  void halveInto(int level, int y) {
    const Image& finer = pyramid_[level - 1];
    Image& half = pyramid_[level];
    halveRow(finer.pixel(0, 2 * y), finer.pixel(0, 2 * y + 1), half.width, half.channels,
             half.pixel(0, y));
  }

  const Rendering& rendering_;
  int rays_;      // along a pixel of the finest level
  int coarsest_;  // level
  Eigen::Vector3f centre_;
  bool grey_;
  PixelBox part_;  // of the rendering
  KeyframePyramid pyramid_;
};

}  // namespace

std::vector<KeyframePyramid> pyramidsOf(const std::vector<RenderedWindow>& windows,
                                        const FieldMetadata& object,
                                        const KeyframeSettings& settings, int threads) {
  std::vector<PyramidMaker> makers;
  makers.reserve(windows.size());
  for (const RenderedWindow& window : windows) {
    makers.emplace_back(window, object.centre, settings);
  }
  parallelForParts(
      threads, static_cast<int>(makers.size()), [&](int i) { return makers[i].coarsestRows(); },
      [&](int i, int row) { makers[i].fillRow(row); });
  std::vector<KeyframePyramid> pyramids;
  pyramids.reserve(makers.size());
  for (PyramidMaker& maker : makers) pyramids.push_back(maker.take());
  return pyramids;
}

}  // namespace nerf_pose_refiner
