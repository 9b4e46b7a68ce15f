// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/keyframe.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <string>

#include "backend/common/image_levels.h"
#include "math/require.h"
#include "views/keyframe_level.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kReach = 0.6;  // of the diameter, as the centre need not be in the middle

/// Half the width of the window that contains the object [px].
double reachInImage(const View& view, const FieldMetadata& object, double distance) {
  return kReach * object.diameter * std::max(view.camera.fx, view.camera.fy) / distance;
}

// As cameras and OpenCV make grey of encoded colours (ITU-R BT.601).
void makeGrey(Image* layers) {
  for (std::size_t i = 0; i < layers->pixels(); ++i) {
    float* pixel = layers->values.data() + kKeyframeChannels * i;
    std::fill_n(pixel, 3, 0.299f * pixel[0] + 0.587f * pixel[1] + 0.114f * pixel[2]);
  }
}

// Premultiplied colour, alpha, and alpha times the point relative to the object's centre.
Image layersOf(const Rendering& rendering, const Eigen::Vector3f& centre) {
  Image layers(rendering.alpha.width, rendering.alpha.height, kKeyframeChannels);
  for (std::size_t i = 0; i < layers.pixels(); ++i) {
    float* pixel = layers.values.data() + kKeyframeChannels * i;
    const float alpha = rendering.alpha.values[i];
    for (std::size_t c = 0; c < 3; ++c) {
      pixel[c] = rendering.colour.values[3 * i + c];
      pixel[kKeyframePoint + c] = rendering.point.values[3 * i + c] - alpha * centre[c];
    }
    pixel[kKeyframeAlpha] = alpha;
  }
  return layers;
}

// The part that shows the object, aligned to whole pixels of the coarsest level.
Image cropped(const Image& layers, int step) {
  int left = layers.width, right = 0, top = layers.height, bottom = 0;
  for (int y = 0; y < layers.height; ++y) {
    for (int x = 0; x < layers.width; ++x) {
      if (layers.at(x, y, kKeyframeAlpha) < 0.5f) continue;
      left = std::min(left, x);
      right = std::max(right, x + 1);
      top = std::min(top, y);
      bottom = std::max(bottom, y + 1);
    }
  }
  // Plus one coarsest pixel on each side, because the outline is compared with its outside.
  left = std::max(0, std::min(left, right) / step * step - step);
  top = std::max(0, std::min(top, bottom) / step * step - step);
  const int width = std::min((right - left + step - 1) / step * step + step, layers.width - left);
  const int height = std::min((bottom - top + step - 1) / step * step + step, layers.height - top);
  Image part(width, height, layers.channels);
  for (int y = 0; y < height; ++y) {
    const float* row = layers.pixel(left, top + y);
    std::copy(row, row + static_cast<std::ptrdiff_t>(width) * layers.channels, part.pixel(0, y));
  }
  return part;
}

int windowOf(const KeyframeSettings& settings, int level) {
  if (settings.levels == 1) return settings.finest_window_px;
  const double coarseness = static_cast<double>(level) / (settings.levels - 1);
  return static_cast<int>(
      std::lround(settings.finest_window_px +
                  coarseness * (settings.coarsest_window_px - settings.finest_window_px)));
}

}  // namespace

void KeyframeSettings::validate() const {
  require(levels >= 1 && levels <= 8, "keyframe: levels", levels);
  require(rays_per_side == 1 || rays_per_side == 2 || rays_per_side == 4, "keyframe: rays_per_side",
          rays_per_side);
  require(max_side_px >= 16, "keyframe: max_side_px", max_side_px);
  require(finest_window_px >= 1, "keyframe: finest_window_px", finest_window_px);
  require(coarsest_window_px >= 1, "keyframe: coarsest_window_px", coarsest_window_px);
  require(max_points >= 6, "keyframe: max_points", max_points);
  require(max_outline >= 0, "keyframe: max_outline", max_outline);
  require(max_shown >= 100, "keyframe: max_shown", max_shown);
  require(min_alpha > 0 && min_alpha < 1, "keyframe: min_alpha", min_alpha);
  require(max_depth_step > 0, "keyframe: max_depth_step", max_depth_step);
}

bool fitsKeyframe(const View& view, const FieldMetadata& object) {
  constexpr double kMaxImages = 16,
                   kMin_px = 8;  // width of the window: in widths of the image, [px]
  constexpr double kMaxAside_px = 1e8;
  const Eigen::Vector3d centre_C = view.T_O_C.inverse() * object.centre;
  if (!(centre_C.z() > kReach * object.diameter)) return false;
  const double side = 2 * reachInImage(view, object, centre_C.z());
  const Eigen::Vector2d middle = view.camera.project(centre_C);
  return side >= kMin_px && side <= kMaxImages * std::max(view.camera.width, view.camera.height) &&
         middle.cwiseAbs().maxCoeff() <= kMaxAside_px;
}

Camera keyframeCamera(const Camera& camera, const Pose& T_O_C, const FieldMetadata& object,
                      const KeyframeSettings& settings, int* reduction) {
  if (!fitsKeyframe({camera, T_O_C}, object)) {
    throw std::invalid_argument(
        "keyframe: the object is not in front of the camera, or far too large or small in its "
        "image");
  }
  const Eigen::Vector3d centre_C = T_O_C.inverse() * object.centre;
  const double reach_px = reachInImage({camera, T_O_C}, object, centre_C.z());
  *reduction = 1;
  while (2 * reach_px > *reduction * settings.max_side_px) *reduction *= 2;
  // Whole pixels of the coarsest level; the window may extend beyond the image.
  const int step = *reduction << (settings.levels - 1);
  const Eigen::Vector2d middle = camera.project(centre_C);
  const int steps = static_cast<int>(std::ceil(2 * reach_px / step)) + 1;
  const int x = static_cast<int>(std::floor(middle.x() - 0.5 * steps * step));
  const int y = static_cast<int>(std::floor(middle.y() - 0.5 * steps * step));
  const int side = steps * step;
  return camera.cropped(x, y, side, side).resized(side / *reduction, side / *reduction);
}

KeyframePoints renderKeyframe(const LoadedField& field, const View& view,
                              const KeyframeSettings& settings,
                              const CancellationToken& cancellation) {
  settings.validate();
  const FieldMetadata& object = field.field().metadata;
  int reduction = 1;
  const Camera window = keyframeCamera(view.camera, view.T_O_C, object, settings, &reduction);
  const int n = settings.rays_per_side;
  const Camera finer = window.resized(n * window.width, n * window.height);
  KeyframePoints keyframe =
      makeKeyframe(field.render({finer, view.T_O_C}, RenderOptions(), cancellation), window,
                   view.T_O_C, object, settings);
  keyframe.camera = view.camera;
  keyframe.reduction = reduction;
  return keyframe;
}

KeyframePoints makeKeyframe(const Rendering& rendering, const Camera& camera, const Pose& T_O_C,
                            const FieldMetadata& object, const KeyframeSettings& settings) {
  settings.validate();
  KeyframePoints keyframe;
  keyframe.camera = camera;
  keyframe.T_O_C = T_O_C;
  keyframe.centre = object.centre;
  keyframe.diameter = object.diameter;
  Image layers = layersOf(rendering, object.centre.cast<float>()), half;
  if (settings.grey) makeGrey(&layers);
  while (layers.width > camera.width) {
    halveImage(layers, &half);
    std::swap(layers, half);
  }
  layers = cropped(layers, 1 << (settings.levels - 1));
  KeyframeView view;
  view.right = T_O_C.R.col(0).cast<float>();
  view.down = T_O_C.R.col(1).cast<float>();
  view.forward = T_O_C.R.col(2).cast<float>();
  view.centre = (T_O_C.inverse() * object.centre).cast<float>();
  for (int level = 0; level < settings.levels; ++level) {
    if (level > 0) {
      halveImage(layers, &half);
      std::swap(layers, half);
    }
    view.focal_px = Eigen::Vector2d(camera.fx, camera.fy).cast<float>() / (1 << level);
    keyframe.levels.push_back(makeLevel(layers, view, windowOf(settings, level), settings));
  }
  return keyframe;
}

}  // namespace nerf_pose_refiner
