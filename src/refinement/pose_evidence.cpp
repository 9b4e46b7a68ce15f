// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "refinement/pose_evidence.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "backend/common/box_sums.h"
#include "backend/common/observed_colours.h"
#include "concurrency/parallel.h"
#include "image/resample.h"
#include "refinement/grey_image.h"
#include "views/splat.h"

namespace nerf_pose_refiner {
namespace {

constexpr float kObjectAlpha = 0.9f;
constexpr int kNeighbourhoods = 8;  // half windows of local means along the image's side
constexpr double kCorrelated_px = 9;
constexpr double kClip = 3;  // [deviations]

float brightness(const float* rgb) { return 0.299f * rgb[0] + 0.587f * rgb[1] + 0.114f * rgb[2]; }

/// Colours less their mean over the object's pixels around.
std::vector<float> detailOf(const Image& colour, const std::vector<char>& is_object) {
  const int width = colour.width, height = colour.height;
  std::vector<float> layers(kBoxChannels * colour.pixels(), 0.0f), sums;
  for (std::size_t i = 0; i < colour.pixels(); ++i) {
    if (!is_object[i]) continue;
    std::copy_n(colour.values.begin() + 3 * i, 3, layers.begin() + kBoxChannels * i);
    layers[kBoxChannels * i + 3] = 1;
  }
  boxSums(layers, width, height, std::max(2, std::max(width, height) / kNeighbourhoods / 2), &sums);
  std::vector<float> detail(3 * colour.pixels(), 0.0f);
  for (std::size_t i = 0; i < colour.pixels(); ++i) {
    if (!is_object[i]) continue;
    const float* sum = sums.data() + kBoxChannels * i;
    for (std::size_t c = 0; c < 3; ++c) {
      detail[3 * i + c] = colour.values[3 * i + c] - sum[c] / std::max(sum[3], 1.0f);
    }
  }
  return detail;
}

/// The gain of rendered details that explains the observed ones best, without outliers.
float gainOf(const std::vector<float>& rendered, const std::vector<float>& observed) {
  constexpr int kRounds = 3;
  constexpr float kMin = 0.3f, kMax = 3, kOutlier = 0.1f;
  float gain = 1;
  for (int round = 0; round < kRounds; ++round) {
    double both = 1e-4, squares = 1e-4;
    for (std::size_t i = 0; i < rendered.size(); ++i) {
      if (std::abs(observed[i] - gain * rendered[i]) > kOutlier) continue;
      both += static_cast<double>(rendered[i]) * observed[i];
      squares += static_cast<double>(rendered[i]) * rendered[i];
    }
    gain = std::clamp(static_cast<float>(both / squares), kMin, kMax);
  }
  return gain;
}

}  // namespace

std::optional<ObjectImage> objectImage(const Observation& observation, const Pose& T_O_C,
                                       const FieldMetadata& object, int object_px) {
  constexpr double kMargin = 1.1;
  constexpr int kMin_px = 8;
  const Camera& camera = observation.camera;
  const Eigen::Vector3d centre_C = T_O_C.inverse() * object.centre;
  if (!(centre_C.z() > 0.5 * object.diameter)) return std::nullopt;
  const Eigen::Vector2d middle = camera.project(centre_C);
  const double diameter_px = object.diameter / centre_C.z() * std::max(camera.fx, camera.fy);
  const double half = 0.5 * kMargin * diameter_px;
  const auto clampTo = [](double x, int size) {
    return static_cast<int>(std::clamp(x, 0.0, static_cast<double>(size)));
  };
  const int left = clampTo(std::floor(middle.x() - half), camera.width);
  const int right = clampTo(std::ceil(middle.x() + half) + 1, camera.width);
  const int top = clampTo(std::floor(middle.y() - half), camera.height);
  const int bottom = clampTo(std::ceil(middle.y() + half) + 1, camera.height);
  if (right - left < kMin_px || bottom - top < kMin_px) return std::nullopt;
  const Camera part = camera.cropped(left, top, right - left, bottom - top);
  ObjectImage image;
  image.camera = part.scaled(std::min(1.0, object_px / diameter_px));
  if (std::min(image.camera.width, image.camera.height) < kMin_px) return std::nullopt;
  image.colour = reducedColours(observation, {left, top, right - left, bottom - top}, image.camera);
  image.weight = observation.weight.empty()
                     ? Image(image.camera.width, image.camera.height, 1, 1.0f)
                     : resample(observation.weight, camera, image.camera);
  image.grey = isGrey(observation).value_or(false);
  return image;
}

PoseEvidence::PoseEvidence(ObjectImage image) : image_(std::move(image)) {}

void PoseEvidence::add(const Rendering& rendering) { shown_.push_back(compared(rendering)); }

void PoseEvidence::addAll(const LoadedField& field, const std::vector<Pose>& poses_T_O_C,
                          const CancellationToken& cancellation) {
  const std::vector<Rendering> renderings =
      field.renderAll(camera(), poses_T_O_C, RenderOptions(), cancellation);
  const std::size_t first = shown_.size();
  shown_.resize(first + renderings.size());
  parallelFor(sideThreads(), static_cast<int>(renderings.size()),
              [&](int i) { shown_[first + i] = compared(renderings[i]); });
}

void PoseEvidence::addAll(const KeyframePoints& keyframe, const std::vector<Pose>& poses_T_O_C) {
  for (const Pose& T_O_C : poses_T_O_C) add(splat(keyframe, {camera(), T_O_C}));
}

PoseEvidence::Shown PoseEvidence::compared(const Rendering& rendering) const {
  const std::size_t pixels = image_.colour.pixels();
  Shown shown;
  shown.is_object.resize(pixels);
  shown.squares.assign(pixels, 0.0f);
  Image colour = rendering.colour;
  for (std::size_t i = 0; i < pixels; ++i) {
    const float alpha = rendering.alpha.values[i];
    shown.is_object[i] = alpha > kObjectAlpha && image_.weight.values[i] > 0.5f;
    float* rgb = colour.values.data() + 3 * i;
    for (int c = 0; c < 3; ++c) rgb[c] /= std::max(alpha, kObjectAlpha);
    if (image_.grey) std::fill_n(rgb, 3, brightness(rgb));
  }
  const std::vector<float> rendered = detailOf(colour, shown.is_object);
  const std::vector<float> observed = detailOf(image_.colour, shown.is_object);
  const float gain = gainOf(rendered, observed);
  for (std::size_t i = 0; i < 3 * pixels; ++i) {
    const float residual = observed[i] - gain * rendered[i];
    shown.squares[i / 3] += residual * residual;
  }
  return shown;
}

double PoseEvidence::of(int pose, int against, double noise) const {
  const Shown &a = shown_[pose], &b = shown_[against];
  const auto meanOf = [](const Shown& shown, double limit) {
    double sum = 0, count = 1;
    for (std::size_t i = 0; i < shown.squares.size(); ++i) {
      if (!shown.is_object[i]) continue;
      sum += std::min<double>(shown.squares[i], limit);
      ++count;
    }
    return sum / count;
  };
  constexpr double kLargest = 0.1;  // of squared residuals: an outlier, whatever else there is
  const double variance =
      std::max(3 * noise * noise, std::min(meanOf(a, kLargest), meanOf(b, kLargest)));
  const double most = kClip * kClip * variance;
  const double by_chance = 0.5 * most;  // where a pose says that there is something else
  double difference = 0;
  for (std::size_t i = 0; i < a.squares.size(); ++i) {
    if (!a.is_object[i] && !b.is_object[i]) continue;
    const double of_a = a.is_object[i] ? std::min<double>(a.squares[i], most) : by_chance;
    const double of_b = b.is_object[i] ? std::min<double>(b.squares[i], most) : by_chance;
    difference += of_b - of_a;
  }
  return difference / (2 * variance * kCorrelated_px);
}

}  // namespace nerf_pose_refiner
