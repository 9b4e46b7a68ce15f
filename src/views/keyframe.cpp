// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/keyframe.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "backend/common/image_levels.h"
#include "concurrency/parallel.h"
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

// Premultiplied colour, alpha, and alpha times the point relative to the object's centre.
Image layersOf(const Rendering& rendering, const PixelBox& part, const Eigen::Vector3f& centre) {
  Image layers(part.width, part.height, kKeyframeChannels);
  for (int y = 0; y < part.height; ++y) {
    const float* alpha = rendering.alpha.pixel(part.left, part.top + y);
    const float* colour = rendering.colour.pixel(part.left, part.top + y);
    const float* point = rendering.point.pixel(part.left, part.top + y);
    float* pixel = layers.pixel(0, y);
    for (int x = 0; x < part.width; ++x, ++alpha, colour += 3, point += 3) {
      for (std::size_t c = 0; c < 3; ++c) {
        pixel[c] = colour[c];
        pixel[kKeyframePoint + c] = point[c] - *alpha * centre[c];
      }
      pixel[kKeyframeAlpha] = *alpha;
      pixel += kKeyframeChannels;
    }
  }
  return layers;
}

// From fine to coarse.
std::vector<Image> pyramidOf(const Rendering& rendering, const Camera& camera,
                             const FieldMetadata& object, const KeyframeSettings& settings) {
  const int rays = rendering.alpha.width / camera.width;
  const PixelBox part = shownPart(rendering.alpha, rays << (settings.levels - 1));
  Image layers = layersOf(rendering, part, object.centre.cast<float>()), half;
  if (settings.grey) makeGrey(&layers);
  for (int n = rays; n > 1; n /= 2) {
    halveImage(layers, &half);
    std::swap(layers, half);
  }
  std::vector<Image> pyramid;
  pyramid.push_back(std::move(layers));
  while (static_cast<int>(pyramid.size()) < settings.levels) {
    halveImage(pyramid.back(), &half);
    pyramid.push_back(std::move(half));
    half = Image();
  }
  return pyramid;
}

// A small object is a matter of fractions of a pixel, and its rays are few.
int raysPerSide(const KeyframeSettings& settings, const Camera& camera) {
  constexpr int kMost = 4;
  const int side = std::max(camera.width, camera.height);
  int rays = settings.rays_per_side;
  while (rays < kMost && 2 * rays * side <= settings.max_rays_of_side) rays *= 2;
  return rays;
}

int windowOf(const KeyframeSettings& settings, int level) {
  if (settings.levels == 1) return settings.finest_window_px;
  const double coarseness = static_cast<double>(level) / (settings.levels - 1);
  return static_cast<int>(
      std::lround(settings.finest_window_px +
                  coarseness * (settings.coarsest_window_px - settings.finest_window_px)));
}

KeyframePoints withoutLevels(const RenderedWindow& window, const FieldMetadata& object) {
  KeyframePoints keyframe;
  keyframe.camera = window.view.camera;
  keyframe.T_O_C = window.view.T_O_C;
  keyframe.centre = object.centre;
  keyframe.diameter = object.diameter;
  keyframe.reduction = window.reduction;
  return keyframe;
}

// In strips of whole rows, so that others who render the field need not wait for the whole image.
Rendering renderInStrips(const LoadedField& field, const View& view,
                         const CancellationToken& cancellation) {
  constexpr int kPixels = 20000;  // of a strip, some milliseconds on two cores
  const Camera& camera = view.camera;
  const int rows = std::max(1, kPixels / camera.width);
  if (field.rendersTogether() || camera.height <= rows) {
    return field.render(view, RenderOptions(), cancellation);
  }
  Rendering whole;
  whole.colour = Image(camera.width, camera.height, 3);
  whole.alpha = Image(camera.width, camera.height, 1);
  whole.point = Image(camera.width, camera.height, 3);
  for (int y = 0; y < camera.height; y += rows) {
    const Camera part = camera.cropped(0, y, camera.width, std::min(rows, camera.height - y));
    const Rendering strip = field.render({part, view.T_O_C}, RenderOptions(), cancellation);
    const auto put = [y](const Image& from, Image* to) {
      std::copy(from.values.begin(), from.values.end(), to->pixel(0, y));
    };
    put(strip.colour, &whole.colour);
    put(strip.alpha, &whole.alpha);
    put(strip.point, &whole.point);
  }
  return whole;
}

KeyframeView levelView(const RenderedWindow& window, const FieldMetadata& object, int level) {
  const Pose& T_O_C = window.view.T_O_C;
  KeyframeView view;
  view.right = T_O_C.R.col(0).cast<float>();
  view.down = T_O_C.R.col(1).cast<float>();
  view.forward = T_O_C.R.col(2).cast<float>();
  view.centre = (T_O_C.inverse() * object.centre).cast<float>();
  const Camera& camera = window.camera;
  view.focal_px = Eigen::Vector2d(camera.fx, camera.fy).cast<float>() / (1 << level);
  return view;
}

}  // namespace

bool operator==(const KeyframeSettings& a, const KeyframeSettings& b) {
  const auto all = [](const KeyframeSettings& s) {
    return std::tie(s.levels, s.max_side_px, s.rays_per_side, s.max_rays_of_side,
                    s.finest_window_px, s.coarsest_window_px, s.max_points, s.max_outline,
                    s.max_shown, s.min_alpha, s.max_depth_step, s.for_starts, s.grey);
  };
  return all(a) == all(b);
}

void KeyframeSettings::validate() const {
  require(levels >= 1 && levels <= 8, "keyframe: levels", levels);
  require(rays_per_side == 1 || rays_per_side == 2 || rays_per_side == 4, "keyframe: rays_per_side",
          rays_per_side);
  require(max_rays_of_side >= 0, "keyframe: max_rays_of_side", max_rays_of_side);
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

RenderedWindow renderWindow(const LoadedField& field, const View& view,
                            const KeyframeSettings& settings,
                            const CancellationToken& cancellation) {
  settings.validate();
  RenderedWindow window;
  window.camera =
      keyframeCamera(view.camera, view.T_O_C, field.field().metadata, settings, &window.reduction);
  window.view = view;
  const int n = raysPerSide(settings, window.camera);
  const Camera finer = window.camera.resized(n * window.camera.width, n * window.camera.height);
  window.rendering = renderInStrips(field, {finer, view.T_O_C}, cancellation);
  return window;
}

std::vector<KeyframePoints> keyframesOf(const std::vector<RenderedWindow>& windows,
                                        const FieldMetadata& object,
                                        const KeyframeSettings& settings) {
  settings.validate();
  const auto count = static_cast<int>(windows.size());
  std::vector<KeyframePoints> keyframes(windows.size());
  std::vector<std::vector<Image>> pyramids(windows.size());
  parallelFor(sideThreads(), count, [&](int i) {
    keyframes[i] = withoutLevels(windows[i], object);
    keyframes[i].levels.resize(settings.levels);
    pyramids[i] = pyramidOf(windows[i].rendering, windows[i].camera, object, settings);
  });
  // The fine levels, which take longest, come first.
  parallelFor(sideThreads(), count * settings.levels, [&](int task) {
    const int i = task % count, level = task / count;
    keyframes[i].levels[level] =
        makeLevel(pyramids[i][level], levelView(windows[i], object, level),
                  windowOf(settings, level), level == 0 && !settings.for_starts, settings);
  });
  return keyframes;
}

KeyframePoints keyframeOf(const RenderedWindow& window, const FieldMetadata& object,
                          const KeyframeSettings& settings) {
  return std::move(keyframesOf({window}, object, settings).front());
}

std::vector<KeyframePoints> renderKeyframes(const LoadedField& field,
                                            const std::vector<View>& views,
                                            const KeyframeSettings& settings,
                                            const CancellationToken& cancellation) {
  settings.validate();
  const auto together = static_cast<std::size_t>(sideThreads());
  std::vector<KeyframePoints> keyframes;
  for (std::size_t first = 0; first < views.size(); first += together) {
    std::vector<RenderedWindow> windows;
    for (std::size_t i = first; i < std::min(first + together, views.size()); ++i) {
      windows.push_back(renderWindow(field, views[i], settings, cancellation));
    }
    for (KeyframePoints& made : keyframesOf(windows, field.field().metadata, settings)) {
      keyframes.push_back(std::move(made));
    }
  }
  return keyframes;
}

KeyframePoints renderKeyframe(const LoadedField& field, const View& view,
                              const KeyframeSettings& settings,
                              const CancellationToken& cancellation) {
  return std::move(renderKeyframes(field, {view}, settings, cancellation).front());
}

}  // namespace nerf_pose_refiner
