// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/outline.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "math/outline_alignment.h"
#include "math/tile_scatter.h"

namespace nerf_pose_refiner {
namespace {

/// A place where the opacity crosses 0.5, in pixels.
struct Crossing {
  Eigen::Vector2f place;
  Eigen::Vector2f outside;  ///< unit vector to the outside
  int pixel = 0;            ///< y * width + x
};

class OutlineFinder {
 public:
  OutlineFinder(const Image& layers, const KeyframeView& view) : layers_(layers), view_(view) {}

  /// On which side of 0.5 the opacity of a row's pixels is.
  std::vector<char> insideOf(int y) const {
    std::vector<char> inside(layers_.width);
    const float* alpha = layers_.pixel(0, y) + kKeyframeAlpha;
    for (char& one : inside) {
      one = *alpha > 0.5f;
      alpha += kKeyframeChannels;
    }
    return inside;
  }

  /// The place between a pixel and its neighbour on the other side of 0.5, to the right or below,
  /// where the opacity crosses 0.5. Only if the outline's normal is closer to that direction than
  /// to the other one.
  std::optional<Crossing> between(int x, int y, bool to_the_right) const {
    const int x2 = x + (to_the_right ? 1 : 0), y2 = y + (to_the_right ? 0 : 1);
    const float a = layers_.at(x, y, kKeyframeAlpha) - 0.5f;
    const float b = layers_.at(x2, y2, kKeyframeAlpha) - 0.5f;
    const float t = a / (a - b);
    const Eigen::Vector2f place(static_cast<float>(x) + (to_the_right ? t : 0),
                                static_cast<float>(y) + (to_the_right ? 0 : t));
    const Eigen::Vector2f slope = slopeAt(place);
    if ((std::abs(slope.x()) >= std::abs(slope.y())) != to_the_right) return std::nullopt;
    const Crossing crossing = {place, -slope.normalized(), y * layers_.width + x};
    if (!isSharp(crossing)) return std::nullopt;
    return crossing;
  }

  OutlinePoint pointOf(const Crossing& crossing) const {
    const Eigen::Vector2f &place = crossing.place, &outside = crossing.outside;
    OutlinePoint found;
    found.look = lookAlong(place, outside);
    // The expected point of an outline pixel is on its inner side, so only its depth is used.
    const float depth = pointAt(place).z();
    const auto inwards = static_cast<float>(kOutlineReach);
    const Eigen::Vector3f inside = pointAt(place - inwards * outside);
    const Eigen::Vector2f per_px = outside.cwiseQuotient(view_.focal_px);
    const Eigen::Vector2f slope = inside.head<2>() / inside.z() + inwards * per_px;
    found.point =
        inObject(Eigen::Vector3f(depth * slope.x(), depth * slope.y(), depth) - view_.centre);
    found.normal = inObject({depth * per_px.x(), depth * per_px.y(), 0});
    return found;
  }

 private:
  float sample(const Eigen::Vector2f& place, int channel) const {
    const float u = std::clamp(place.x(), 0.0f, static_cast<float>(layers_.width - 1));
    const float v = std::clamp(place.y(), 0.0f, static_cast<float>(layers_.height - 1));
    const int x = std::min(static_cast<int>(u), layers_.width - 2);
    const int y = std::min(static_cast<int>(v), layers_.height - 2);
    const float fu = u - static_cast<float>(x), fv = v - static_cast<float>(y);
    const float upper = (1 - fu) * layers_.at(x, y, channel) + fu * layers_.at(x + 1, y, channel);
    const float lower =
        (1 - fu) * layers_.at(x, y + 1, channel) + fu * layers_.at(x + 1, y + 1, channel);
    return (1 - fv) * upper + fv * lower;
  }

  // The expected point at a place, in the camera's frame.
  Eigen::Vector3f pointAt(const Eigen::Vector2f& place) const {
    Eigen::Vector3f point;
    for (int c = 0; c < 3; ++c) point[c] = sample(place, kKeyframePoint + c);
    point /= sample(place, kKeyframeAlpha);
    return view_.centre +
           Eigen::Vector3f(view_.right.dot(point), view_.down.dot(point), view_.forward.dot(point));
  }

  Eigen::Vector3f inObject(const Eigen::Vector3f& direction_C) const {
    return direction_C.x() * view_.right + direction_C.y() * view_.down +
           direction_C.z() * view_.forward;
  }

  // Zero outside the layers.
  float opacityAt(const Eigen::Vector2f& place) const {
    const bool inside = place.x() >= -0.5f && place.y() >= -0.5f &&
                        place.x() <= static_cast<float>(layers_.width) - 0.5f &&
                        place.y() <= static_cast<float>(layers_.height) - 0.5f;
    return inside ? sample(place, kKeyframeAlpha) : 0;
  }

  Eigen::Vector2f slopeAt(const Eigen::Vector2f& place) const {
    const Eigen::Vector2f right(1, 0), down(0, 1);
    return {opacityAt(place + right) - opacityAt(place - right),
            opacityAt(place + down) - opacityAt(place - down)};
  }

  // Whether within a few pixels it is opaque on one side, and empty on the other.
  bool isSharp(const Crossing& crossing) const {
    constexpr float kOpaque = 0.9f, kClear = 0.1f;
    for (int s = kOutlineReach - 1; s <= kOutlineReach; ++s) {
      const Eigen::Vector2f away = static_cast<float>(s) * crossing.outside;
      if (opacityAt(crossing.place - away) < kOpaque) return false;
      if (opacityAt(crossing.place + away) > kClear) return false;
    }
    return true;
  }

  Eigen::Array3f colourAt(const Eigen::Vector2f& place) const {
    return Eigen::Array3f(sample(place, 0), sample(place, 1), sample(place, 2)) /
           sample(place, kKeyframeAlpha);
  }

  // The light on the object is another one than the model learned, so its shading is believed in
  // part: colours differ by this power of what they differ by in the keyframe.
  OutlineLook<float> lookAlong(const Eigen::Vector2f& place, const Eigen::Vector2f& outside) const {
    constexpr float kBelieved = 0.7f, kMost = 3;
    constexpr float kDark = 0.05f;  // added to colours, as ratios of dark ones are noise
    constexpr float kShown = 0.2f;  // less opacity shows too little of the object's colour
    constexpr auto reach = static_cast<float>(kOutlineReach);
    const Eigen::Array3f inside =
        0.5f * (colourAt(place - reach * outside) + colourAt(place - (reach - 1) * outside));
    Eigen::Array3f colour = inside;
    OutlineLook<float> look;
    for (int i = 0; i < kOutlineOpacities; ++i) {
      const Eigen::Vector2f there = place + static_cast<float>(i - kOutlineCompared) * outside;
      look.opacity[i] = opacityAt(there);
      if (look.opacity[i] > kShown) colour = colourAt(there);
      const Eigen::Array3f ratio = ((colour + kDark) / (inside + kDark)).max(1 / kMost).min(kMost);
      Eigen::Map<Eigen::Array3f>(look.shade[i]) = ratio.pow(kBelieved);
    }
    return look;
  }

  const Image& layers_;
  const KeyframeView& view_;
};

}  // namespace

std::vector<OutlinePlace> outlineOf(const Image& layers, const KeyframeView& view, int max_count) {
  const OutlineFinder finder(layers, view);
  std::vector<Crossing> all;
  if (layers.width < 2 || layers.height < 2) return {};
  std::vector<char> row = finder.insideOf(0), below;
  for (int y = 0; y + 1 < layers.height; ++y, row.swap(below)) {
    below = finder.insideOf(y + 1);
    for (int x = 0; x + 1 < layers.width; ++x) {
      for (const bool to_the_right : {true, false}) {
        if (row[x] == (to_the_right ? row[x + 1] : below[x])) continue;
        if (const auto crossing = finder.between(x, y, to_the_right)) all.push_back(*crossing);
      }
    }
  }
  // Evenly: one of so many along a path from small tile to small tile.
  const int width = layers.width, small_tiles = (width + kTileSide - 1) / kTileSide;
  const auto small_tile_of = [width, small_tiles](const Crossing& one) {
    return one.pixel / width / kTileSide * small_tiles + one.pixel % width / kTileSide;
  };
  std::stable_sort(all.begin(), all.end(), [&](const auto& a, const auto& b) {
    return small_tile_of(a) < small_tile_of(b);
  });
  std::vector<OutlinePlace> some;
  const std::size_t count = std::min(all.size(), static_cast<std::size_t>(max_count));
  for (std::size_t i = 0; i < count; ++i) {
    const Crossing& crossing = all[i * all.size() / count];
    some.push_back({finder.pointOf(crossing), crossing.pixel});
  }
  std::stable_sort(some.begin(), some.end(), [width](const auto& a, const auto& b) {
    return tileOfPixel(a.pixel, width) < tileOfPixel(b.pixel, width);
  });
  return some;
}

}  // namespace nerf_pose_refiner
