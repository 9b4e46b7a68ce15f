// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluation/placement.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

#include "evaluation/aimed_view.h"
#include "image/colour.h"
#include "image/resample.h"
#include "math/angle.h"
#include "math/random.h"

namespace nerf_pose_refiner {
namespace {

constexpr std::uint64_t kStream = 71, kTurnStream = 75;  // of random numbers

}  // namespace

Eigen::AlignedBox2d silhouetteBox(const PosedView& view) {
  constexpr int kOpaque = 128;  // half of it
  Eigen::AlignedBox2d box;
  for (int y = 0; y < view.rgba->height; ++y) {
    for (int x = 0; x < view.rgba->width; ++x) {
      if (view.rgba->at(x, y, 3) >= kOpaque) box.extend(Eigen::Vector2d(x, y));
    }
  }
  if (box.isEmpty()) throw std::invalid_argument("'" + view.name + "' shows no object");
  return box;
}

PosedView placed(const PosedView& upright, const Placement& placement,
                 const DisturbanceDraw& draw) {
  const double turn = 2 * kPi * randomUniform(draw.seed, kTurnStream, draw.index);
  const PosedView view = placement.is_turned ? turned(upright, turn) : upright;
  const auto drawn = [&](std::uint64_t k) {
    return static_cast<double>(randomUniform(draw.seed, kStream, 3 * draw.index + k));
  };
  const PremultipliedImage object = premultiply(*view.rgba);
  const Eigen::AlignedBox2d box = silhouetteBox(view);
  const double most = std::min(placement.most_width * placement.width / box.sizes().maxCoeff(),
                               placement.height / (box.sizes().y() + 2));
  const double least =
      std::min(most, placement.least_width * placement.width / box.sizes().maxCoeff());
  const double scale = least * std::pow(most / least, drawn(0));

  PosedView result = view;
  const Camera resized = view.camera.scaled(scale);
  const auto offset = [&](int axis, int side, std::uint64_t k) {
    const double first = scale * box.min()[axis], last = scale * box.max()[axis];
    return static_cast<int>(std::floor(first - drawn(k) * (side - (last - first) - 1)));
  };
  result.camera = resized.cropped(offset(0, placement.width, 1), offset(1, placement.height, 2),
                                  placement.width, placement.height);
  result.photo_camera = result.camera;
  result.distortion = {};
  PremultipliedImage small;
  small.colour = resample(object.colour, view.camera, result.camera);
  small.alpha = resample(object.alpha, view.camera, result.camera);
  result.rgba = std::make_shared<const Image8>(straightBytes(small));
  return result;
}

}  // namespace nerf_pose_refiner
