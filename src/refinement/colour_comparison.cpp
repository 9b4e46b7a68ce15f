// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/colour_comparison.h"

#include <Eigen/Core>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "backend/common/observed_colours.h"
#include "math/median.h"
#include "refinement/grey_image.h"

namespace nerf_pose_refiner {
namespace {

/// A pixel of the keyframe and what the image shows there, 0..1.
struct ColourPair {
  Eigen::Array3d known, seen;
};

Eigen::Vector2d chromaticity(const Eigen::Array3d& colour) {
  return Eigen::Vector2d(colour[0], colour[2]) / colour.sum();
}

/// The image around a pose, reduced to a level of the keyframe.
struct ReducedImage {
  Image colours;
  Camera camera;

  /// Nothing outside of it.
  const float* at(const Eigen::Vector3d& point_C) const {
    if (!(point_C.z() > 0)) return nullptr;
    const Eigen::Vector2d pixel = camera.project(point_C);
    const long x = std::lround(pixel.x()), y = std::lround(pixel.y());
    if (x < 0 || y < 0 || x >= colours.width || y >= colours.height) return nullptr;
    return colours.pixel(static_cast<int>(x), static_cast<int>(y));
  }
};

ReducedImage reducedImage(const KeyframePoints& keyframe, const Observation& observation,
                          const Pose& T_C_O, double pixels) {
  const Camera& camera = observation.camera;
  constexpr double kReach = 0.6, kSpare = 1.1;  // of the diameter, as the centre need not be in the
                                                // middle; and beside the optical axis
  const Eigen::Vector3d centre_C = T_C_O * keyframe.centre;
  if (!(centre_C.z() > 0)) return {};
  const Eigen::Vector2d centre = camera.project(centre_C);
  const double diameter = keyframe.diameter * camera.fx / centre_C.z();
  const auto clamped = [](double value, int most) {
    return static_cast<int>(std::clamp<double>(std::floor(value), 0, most));
  };
  PixelWindow window;
  const double radius = kReach * keyframe.diameter, squared = centre_C.z() * centre_C.z();
  const double reach = squared > 1.01 * radius * radius
                           ? kSpare * camera.fx * radius / std::sqrt(squared - radius * radius)
                           : static_cast<double>(camera.width + camera.height);
  window.x = clamped(centre.x() - reach, camera.width);
  window.y = clamped(centre.y() - reach, camera.height);
  window.width = clamped(centre.x() + reach + 1, camera.width) - window.x;
  window.height = clamped(centre.y() + reach + 1, camera.height) - window.y;
  if (window.empty()) return {};
  const Camera part = camera.cropped(window.x, window.y, window.width, window.height);
  const double scale = std::min(1.0, pixels / diameter);
  if (scale == 1) return {observedColours(observation, window), part};
  const Camera reduced = part.scaled(scale);
  return {reducedColours(observation, window, reduced), reduced};
}

std::vector<ColourPair> pairsOf(const KeyframePoints& keyframe, const Observation& observation,
                                const Pose& T_C_O) {
  constexpr double kPixels = 64;    // that the object spans: noise is averaged
  constexpr int kMost = 1000;       // pairs
  constexpr float kDark = 0.2f;     // sum of the channels
  constexpr float kBright = 0.97f;  // a channel may be clipped
  const ReducedImage image = reducedImage(keyframe, observation, T_C_O, kPixels);
  std::vector<ColourPair> pairs;
  if (image.colours.empty()) return pairs;
  const KeyframeLevel& level = keyframe.levels.front();
  const PointColumns& shown = level.shown;
  const int none = level.width * level.height;
  const int step = std::max(1, shown.size() / kMost);
  for (int i = 0; i < shown.size(); i += step) {
    const auto k = static_cast<std::size_t>(i);
    if (shown.cell[k] == none) continue;
    const Eigen::Vector3d point_O =
        keyframe.centre + Eigen::Vector3d(shown.x[k], shown.y[k], shown.z[k]);
    const float* const seen = image.at(T_C_O * point_O);
    if (seen == nullptr || seen[0] + seen[1] + seen[2] < kDark) continue;
    if (std::max({seen[0], seen[1], seen[2]}) > kBright) continue;
    ColourPair pair;
    for (int c = 0; c < 3; ++c) {
      pair.known[c] = level.shown_colour[c][k];
      pair.seen[c] = seen[c];
    }
    if (pair.known.sum() >= kDark) pairs.push_back(pair);
  }
  return pairs;
}

/// Gains that make the seen colours as the known ones, as far as light may change them.
Eigen::Array3d gainsOf(const std::vector<ColourPair>& pairs) {
  constexpr double kMostTint = 0.35;  // logarithm of a channel's gain over that of all
  constexpr double kSmall = 0.02;
  Eigen::Array3d logs;
  for (int c = 0; c < 3; ++c) {
    std::vector<double> ratios;
    for (const ColourPair& pair : pairs) {
      ratios.push_back(std::log((pair.known[c] + kSmall) / (pair.seen[c] + kSmall)));
    }
    logs[c] = medianOf(std::move(ratios));
  }
  const double mean = logs.mean();
  return (mean + (logs - mean).max(-kMostTint).min(kMostTint)).exp();
}

}  // namespace

std::optional<double> chromaticDifference(const KeyframePoints& keyframe,
                                          const Observation& observation, const Pose& T_O_C) {
  constexpr std::size_t kFewest = 30;
  if (isGrey(observation).value_or(true)) return std::nullopt;
  const std::vector<ColourPair> pairs = pairsOf(keyframe, observation, T_O_C.inverse());
  if (pairs.size() < kFewest) return std::nullopt;
  const Eigen::Array3d gains = gainsOf(pairs);
  std::vector<double> distances;
  for (const ColourPair& pair : pairs) {
    distances.push_back((chromaticity(pair.seen * gains) - chromaticity(pair.known)).norm());
  }
  return medianOf(std::move(distances));
}

}  // namespace nerf_pose_refiner
