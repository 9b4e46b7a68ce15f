// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "detection/depth_layers.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "detection/large_planes.h"

namespace nerf_pose_refiner {
namespace {

// One channel is dark and one is bright: whatever grey or pale colour is beside it, there is an
// edge.
constexpr float kPaint[3] = {0, 1, 0.5f};

/// Fills what was not measured between two pixels of a line: with the farther one, for a stereo
/// camera sees nothing beside a near object's edge, where the background is hidden from one of its
/// eyes.
void fillLine(float* line, int count, std::ptrdiff_t step) {
  int last = -1;  // that was measured
  for (int i = 0; i < count; ++i) {
    if (!(line[i * step] > 0)) continue;
    for (int k = last + 1; last >= 0 && k < i; ++k) {
      line[k * step] = std::max(line[last * step], line[i * step]);
    }
    last = i;
  }
}

/// Along rows, and then along columns what has no measured pixel to one side.
void fill(ImageOf<float>* metres) {
  for (int y = 0; y < metres->height; ++y) fillLine(metres->pixel(0, y), metres->width, 1);
  for (int x = 0; x < metres->width; ++x) {
    fillLine(metres->pixel(x, 0), metres->height, metres->width);
  }
}

/// [m]; 0: not measured. Nothing: too little is.
std::optional<ImageOf<float>> measuredBy(const DepthImage& depth) {
  constexpr double kLeastMeasured = 0.1;  // of the image
  ImageOf<float> metres(depth.camera.width, depth.camera.height, 1);
  std::size_t measured = 0;
  for (int y = 0; y < metres.height; ++y) {
    for (int x = 0; x < metres.width; ++x) {
      const float z = depth.at(x, y);
      metres.at(x, y, 0) = z;
      measured += z > 0;
    }
  }
  const auto pixels = static_cast<double>(metres.pixels());
  if (static_cast<double>(measured) < kLeastMeasured * pixels) return std::nullopt;
  return metres;
}

/// What a camera sees of a depth image [m]; 0: it is not known.
class SeenDepth {
 public:
  explicit SeenDepth(const Camera& camera)
      : camera_(camera), metres_(camera.width, camera.height, 1) {}

  /// @param wide_px that the pixel of the depth image is in the camera's image. Of one that is
  /// wider than makes sense, its middle counts.
  void add(const Eigen::Vector3d& p_C, double wide_px) {
    constexpr double kWidest_px = 8, kFarthest_m = 1e6;
    if (!(p_C.z() > 0 && p_C.z() < kFarthest_m)) return;
    const double width_px = std::min(wide_px, kWidest_px);
    const Eigen::Vector2d at = camera_.project(p_C);
    if (!at.allFinite()) return;
    const auto z = static_cast<float>(p_C.z());
    const int left = first(at.x(), width_px), right = last(at.x(), width_px, camera_.width);
    const int top = first(at.y(), width_px), bottom = last(at.y(), width_px, camera_.height);
    for (int v = top; v <= bottom; ++v) {
      for (int u = left; u <= right; ++u) {
        float& nearest = metres_.at(u, v, 0);
        if (!(nearest > 0) || z < nearest) nearest = z;
      }
    }
  }

  ImageOf<float> take() && { return std::move(metres_); }

 private:
  static int first(double middle, double width) {
    return static_cast<int>(std::clamp(std::ceil(middle - width / 2), 0.0, 1e6));
  }
  static int last(double middle, double width, int size) {
    return static_cast<int>(std::clamp(std::ceil(middle + width / 2) - 1, -1.0, size - 1.0));
  }

  Camera camera_;
  ImageOf<float> metres_;
};

/// Takes away the table and the walls: nothing that is looked for is as wide.
void removeSupport(const DepthNoise& noise, const Camera& camera, double diameter_m,
                   ImageOf<float>* metres) {
  constexpr double kWide = 1.5, kRough = 0.01;  // [diameters]
  constexpr double kDeviations = 2;
  PlaneSearch search;
  search.least_width_m = kWide * diameter_m;
  search.tolerance_m = kRough * diameter_m + kDeviations * noise.constant_m;
  search.quadratic_per_m = kDeviations * noise.quadratic_per_m;
  const std::vector<Plane> planes = largePlanes(*metres, camera, search);
  for (int y = 0; y < metres->height && !planes.empty(); ++y) {
    for (int x = 0; x < metres->width; ++x) {
      float& z = metres->at(x, y, 0);
      const Eigen::Vector3d p = z * camera.direction(x, y);
      const bool is_support = std::any_of(
          planes.begin(), planes.end(), [&](const Plane& plane) { return search.isOn(plane, p); });
      if (is_support) z = std::numeric_limits<float>::infinity();  // as if it were far behind
    }
  }
}

}  // namespace

std::optional<DepthLayers> DepthLayers::of(const DepthImage& depth, const Camera& camera,
                                           const FieldMetadata& object) {
  if (!(object.metres_per_unit > 0)) return std::nullopt;
  std::optional<ImageOf<float>> measured = measuredBy(depth);
  if (!measured) return std::nullopt;
  fill(&*measured);  // now: through a hole in the object, the other camera would see the wall
  const Camera& of_depth = depth.camera;
  const double per_pixel = std::max(camera.fx / of_depth.fx, camera.fy / of_depth.fy);
  SeenDepth seen(camera);
  for (int y = 0; y < of_depth.height; ++y) {
    for (int x = 0; x < of_depth.width; ++x) {
      const double z = measured->at(x, y, 0);
      if (!(z > 0)) continue;
      const Eigen::Vector3d p_C = depth.T_C_D * (z * of_depth.direction(x, y));
      seen.add(p_C, per_pixel * z / std::max(1e-6, p_C.z()));
    }
  }
  ImageOf<float> metres = std::move(seen).take();
  fill(&metres);
  const double diameter_m = object.metres_per_unit * object.diameter;
  removeSupport(depth.noise, camera, diameter_m, &metres);
  for (int y = 0; y < camera.height; ++y) {
    for (int x = 0; x < camera.width; ++x) {
      // As the distances of templates, @see posePlaced: beside the axis, things look larger.
      const double along = camera.direction(x, y).normalized().z();
      metres.at(x, y, 0) *= static_cast<float>(std::sqrt(along));
    }
  }
  return DepthLayers(std::move(metres), camera, diameter_m);
}

std::optional<DepthLayers::Layer> DepthLayers::at(double distance, double reach,
                                                  const Image& colours) const {
  constexpr double kRadius = 0.55;  // [diameters], with what the sensor adds
  constexpr int kLeastSide = 64;    // [px]
  const double z_m = distance * diameter_m_;
  const float nearest = static_cast<float>(z_m / reach - kRadius * diameter_m_);
  const float farthest = static_cast<float>(z_m * reach + kRadius * diameter_m_);
  std::vector<char> is_within(colours.pixels());
  int left = camera_.width, top = camera_.height, right = -1, bottom = -1;
  for (int y = 0; y < camera_.height; ++y) {
    for (int x = 0; x < camera_.width; ++x) {
      const float z = metres_.at(x, y, 0);
      if (!(z > 0 && z > nearest && z < farthest)) continue;
      is_within[static_cast<std::size_t>(y) * camera_.width + x] = 1;
      left = std::min(left, x);
      right = std::max(right, x);
      top = std::min(top, y);
      bottom = y;
    }
  }
  if (right < 0) return std::nullopt;
  // The centre of a hollow object is beside its surface.
  const double radius_px = 0.5 * camera_.fx / distance;
  const int margin =
      1 + static_cast<int>(std::min<double>(radius_px, camera_.width + camera_.height));
  left = std::max(0, std::min(left - margin, camera_.width - kLeastSide));
  top = std::max(0, std::min(top - margin, camera_.height - kLeastSide));
  right = std::min(camera_.width, std::max(right + margin + 1, left + kLeastSide));
  bottom = std::min(camera_.height, std::max(bottom + margin + 1, top + kLeastSide));
  Layer layer;
  layer.window = {left, top, right - left, bottom - top};
  layer.colours = Image(layer.window.width, layer.window.height, 3);
  for (int y = top; y < bottom; ++y) {
    for (int x = left; x < right; ++x) {
      const bool is_shown = is_within[static_cast<std::size_t>(y) * camera_.width + x] != 0;
      const float* const from = is_shown ? colours.pixel(x, y) : kPaint;
      std::copy(from, from + 3, layer.colours.pixel(x - left, y - top));
    }
  }
  return layer;
}

}  // namespace nerf_pose_refiner
