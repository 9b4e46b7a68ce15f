// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "trial_observation.h"

#include <algorithm>
#include <cmath>

#include "clutter.h"
#include "nerf_pose_refiner/image/colour.h"
#include "nerf_pose_refiner/image/io.h"
#include "nerf_pose_refiner/image/resample.h"
#include "nerf_pose_refiner/maths/random.h"

namespace nerf_pose_refiner {
namespace {

// A photo that fills the picture, its middle cut out.
Image photoOfSize(const std::string& path, const Camera& camera) {
  const Image photo = toFloat(readImage(path));
  const double scale = std::max(static_cast<double>(camera.width) / photo.width,
                                static_cast<double>(camera.height) / photo.height);
  Camera from{photo.width, photo.height, 1, 1, (photo.width - 1) / 2.0, (photo.height - 1) / 2.0};
  Camera to{camera.width,
            camera.height,
            scale,
            scale,
            (camera.width - 1) / 2.0,
            (camera.height - 1) / 2.0};
  return resample(photo, from, to);
}

}  // namespace

// Another light: gain in 1 +- light per channel and an offset; the object's alone.
void TrialObservation::relight(std::uint64_t index, Image* colour, const Image& alpha) const {
  for (int c = 0; c < 3; ++c) {
    const auto draw = [&](int k) { return 2 * randomUniform(seed, 77, 6 * index + 2 * c + k) - 1; };
    const float gain = 1 + static_cast<float>(light) * draw(0);
    const float bias = static_cast<float>(light) / 6 * draw(1);
    for (std::size_t i = 0; i < alpha.pixels(); ++i) {
      float& value = colour->values[3 * i + c];
      value = std::min(std::max(gain * value + bias * alpha.values[i], 0.0f), alpha.values[i]);
    }
  }
}

// A dark square over a share of the object's box.
void TrialObservation::occlude(std::uint64_t index, const Image& alpha, Image* image) const {
  int x0 = alpha.width, y0 = alpha.height, x1 = 0, y1 = 0;
  for (int y = 0; y < alpha.height; ++y) {
    for (int x = 0; x < alpha.width; ++x) {
      if (alpha.at(x, y, 0) < 0.5f) continue;
      x0 = std::min(x0, x), x1 = std::max(x1, x), y0 = std::min(y0, y), y1 = std::max(y1, y);
    }
  }
  if (x1 < x0) return;
  const double side = std::sqrt(occluder * (x1 - x0) * (y1 - y0));
  const int left = x0 + static_cast<int>((x1 - x0 - side) * randomUniform(seed, 78, 2 * index));
  const int top = y0 + static_cast<int>((y1 - y0 - side) * randomUniform(seed, 78, 2 * index + 1));
  for (int y = std::max(0, top); y < std::min<int>(alpha.height, top + side); ++y) {
    for (int x = std::max(0, left); x < std::min<int>(alpha.width, left + side); ++x) {
      const float stripe = (x / 8 + y / 8) % 2 ? 0.35f : 0.25f;
      for (int c = 0; c < 3; ++c) image->at(x, y, c) = stripe + 0.05f * c;
    }
  }
}

void TrialObservation::addNoise(std::uint64_t index, Image* image) const {
  for (std::size_t i = 0; i < image->values.size(); ++i) {
    float sum = -6;  // of twelve uniform numbers: nearly Gaussian
    for (int k = 0; k < 12; ++k) sum += randomUniform(seed, 79 + index, 12 * i + k);
    float& value = image->values[i];
    value = std::min(1.0f, std::max(0.0f, value + static_cast<float>(noise) * sum));
  }
}

Observation TrialObservation::of(const PosedView& view, std::uint64_t index) const {
  PremultipliedImage picture = premultiply(*view.rgba);
  Observation observation;
  observation.camera = view.camera;
  if (light > 0) relight(index, &picture.colour, picture.alpha);
  if (background == "alpha") {
    observation.background = Background::kKnownAlpha;
    observation.image = picture.colour;
    observation.alpha = picture.alpha;
  } else if (background == "white") {
    observation.background = Background::kKnownColour;
    observation.background_colour = Eigen::Vector3f::Ones();
    observation.image = composite(picture, {1, 1, 1});
  } else {
    const Image photo = photos.empty()
                            ? clutter(view.camera.width, view.camera.height, seed + index)
                            : photoOfSize(photos.at(index % photos.size()), view.camera);
    observation.image = picture.colour;
    for (std::size_t i = 0; i < photo.values.size(); ++i) {
      observation.image.values[i] += (1 - picture.alpha.values[i / 3]) * photo.values[i];
    }
    observation.background = background == "mask" ? Background::kMask : Background::kUnknown;
    if (background == "mask") observation.alpha = picture.alpha;
  }
  if (occluder > 0) occlude(index, picture.alpha, &observation.image);
  if (noise > 0) addNoise(index, &observation.image);
  return observation;
}

}  // namespace nerf_pose_refiner
