// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "views/keyframe.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <tuple>
#include <utility>

#include "concurrency/parallel.h"
#include "math/require.h"
#include "views/keyframe_level.h"
#include "views/keyframe_pyramid.h"

namespace nerf_pose_refiner {
namespace {

constexpr double kReach = 0.6;  // of the diameter, as the centre need not be in the middle

/// Half the width of the window that contains the object [px].
double reachInImage(const View& view, const FieldMetadata& object, double distance) {
  return kReach * object.diameter * std::max(view.camera.fx, view.camera.fy) / distance;
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
  const int threads = sideThreads();
  std::vector<KeyframePyramid> pyramids = pyramidsOf(windows, object, settings, threads);
  std::vector<LevelSource> sources;  // the fine levels, which take longest, come first
  for (int level = 0; level < settings.levels; ++level) {
    for (std::size_t i = 0; i < windows.size(); ++i) {
      LevelSource source;
      source.layers = std::move(pyramids[i][level]);
      source.view = levelView(windows[i], object, level);
      source.window = windowOf(settings, level);
      source.holds_distance = level == 0 && !settings.for_starts;
      sources.push_back(std::move(source));
    }
  }
  std::vector<KeyframeLevel> levels = makeLevels(sources, settings, threads);
  std::vector<KeyframePoints> keyframes;
  for (std::size_t i = 0; i < windows.size(); ++i) {
    keyframes.push_back(withoutLevels(windows[i], object));
    for (std::size_t k = i; k < levels.size(); k += windows.size()) {
      keyframes.back().levels.push_back(std::move(levels[k]));
    }
  }
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
