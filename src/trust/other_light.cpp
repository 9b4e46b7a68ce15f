// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trust/other_light.h"

#include <Eigen/Geometry>

#include <algorithm>
#include <cmath>

namespace nerf_pose_refiner {
namespace {

constexpr float kOpaque = 0.9f;  // of pixels whose point is on the surface
constexpr int kReach = 2;        // pixels around one that lend it their light

class SurfaceLight {
 public:
  SurfaceLight(const Rendering& rendering, const Eigen::Vector3f& change)
      : rendering_(rendering), width_(rendering.alpha.width), height_(rendering.alpha.height) {
    gain_ = Image(width_, height_, 1);  // 0: not known
    for (int y = 1; y + 1 < height_; ++y) {
      for (int x = 1; x + 1 < width_; ++x) {
        if (isSurface(x, y)) gain_.at(x, y, 0) = std::exp(change.dot(normalAt(x, y)));
      }
    }
  }

  /// The mean around a pixel, so that those at the outline are lit like the surface beside them.
  float around(int x, int y) const {
    float sum = 0, count = 0;
    for (int v = std::max(0, y - kReach); v <= std::min(height_ - 1, y + kReach); ++v) {
      for (int u = std::max(0, x - kReach); u <= std::min(width_ - 1, x + kReach); ++u) {
        const float gain = gain_.at(u, v, 0);
        sum += gain;
        count += gain > 0 ? 1 : 0;
      }
    }
    return count > 0 ? sum / count : 1;
  }

 private:
  bool isSurface(int x, int y) const {
    const Image& alpha = rendering_.alpha;
    return alpha.at(x, y, 0) > kOpaque && alpha.at(x - 1, y, 0) > kOpaque &&
           alpha.at(x + 1, y, 0) > kOpaque && alpha.at(x, y - 1, 0) > kOpaque &&
           alpha.at(x, y + 1, 0) > kOpaque;
  }

  Eigen::Vector3f pointAt(int x, int y) const {
    return Eigen::Map<const Eigen::Vector3f>(rendering_.point.pixel(x, y)) /
           rendering_.alpha.at(x, y, 0);
  }

  Eigen::Vector3f normalAt(int x, int y) const {
    const Eigen::Vector3f right = pointAt(x + 1, y) - pointAt(x - 1, y);
    const Eigen::Vector3f down = pointAt(x, y + 1) - pointAt(x, y - 1);
    return right.cross(down).normalized();
  }

  const Rendering& rendering_;
  int width_, height_;
  Image gain_;
};

}  // namespace

void dim(Image* image) {
  constexpr float kTint[3] = {1, 0.85f, 0.7f};
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x) {
      const float light = 0.5f + 0.6f * static_cast<float>(x) / static_cast<float>(image->width);
      for (int c = 0; c < 3; ++c) image->at(x, y, c) *= light * kTint[c];
    }
  }
}

void relight(const Rendering& rendering, const Eigen::Vector3f& change, Image* image) {
  const SurfaceLight light(rendering, change);
  for (int y = 0; y < image->height; ++y) {
    for (int x = 0; x < image->width; ++x) {
      if (rendering.alpha.at(x, y, 0) == 0) continue;
      const float gain = 1 + rendering.alpha.at(x, y, 0) * (light.around(x, y) - 1);
      for (int c = 0; c < 3; ++c) image->at(x, y, c) = std::min(1.0f, gain * image->at(x, y, c));
    }
  }
}

}  // namespace nerf_pose_refiner
