// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "nerf_pose_refiner/depth.h"

#include <cmath>
#include <cstring>
#include <stdexcept>
#include <utility>

#include "math/require.h"

namespace nerf_pose_refiner {
namespace {

template <typename T>
std::shared_ptr<const DepthImage> keptDepth(ImageOf<T> image, DepthImage depth) {
  if (image.channels != 1 || image.width != depth.camera.width ||
      image.height != depth.camera.height || image.values.size() != image.pixels()) {
    throw std::invalid_argument("depthImage: the image does not have the camera's size");
  }
  depth.row_bytes = sizeof(T) * static_cast<std::size_t>(image.width);
  const auto kept = std::make_shared<const ImageOf<T>>(std::move(image));
  depth.data = kept->values.data();
  depth.owner = kept;
  depth.validate();
  return std::make_shared<const DepthImage>(std::move(depth));
}

DepthImage depthOf(DepthImage::Format format, const Camera& camera, const Pose& T_C_D,
                   const DepthNoise& noise) {
  DepthImage depth;
  depth.format = format;
  depth.camera = camera;
  depth.T_C_D = T_C_D;
  depth.noise = noise;
  return depth;
}

}  // namespace

double DepthNoise::deviation_m(double distance_m, double format_step_m) const {
  const double squared = distance_m * distance_m;
  const double step = std::hypot(step_m * squared, format_step_m);
  return std::sqrt(constant_m * constant_m + quadratic_per_m * quadratic_per_m * squared * squared +
                   step * step / 12);
}

double DepthNoise::biasDeviation_m(double distance_m) const {
  return std::hypot(bias_m, bias_fraction * distance_m);
}

float DepthImage::at(int x, int y) const {
  const char* const row = static_cast<const char*>(data) + static_cast<std::size_t>(y) * row_bytes;
  if (format == Format::kUint16) {
    std::uint16_t value;
    std::memcpy(&value, row + sizeof value * static_cast<std::size_t>(x), sizeof value);
    return static_cast<float>(unit_m) * static_cast<float>(value);
  }
  float value;
  std::memcpy(&value, row + sizeof value * static_cast<std::size_t>(x), sizeof value);
  return std::isfinite(value) && value > 0 ? value : 0;
}

void DepthImage::validate() const {
  camera.validate();
  if (data == nullptr) throw std::invalid_argument("DepthImage::data is missing");
  const std::size_t bytes = format == Format::kUint16 ? sizeof(std::uint16_t) : sizeof(float);
  require(row_bytes >= bytes * static_cast<std::size_t>(camera.width), "DepthImage::row_bytes",
          static_cast<double>(row_bytes), "a row of the camera's width or more");
  require(unit_m > 0 && std::isfinite(unit_m), "DepthImage::unit_m", unit_m, "above 0");
  if (!T_C_D.isFinite() || !T_C_D.isRigid()) {
    throw std::invalid_argument("DepthImage::T_C_D is not a rigid transform");
  }
  const auto notNegative = [](const char* name, double value) {
    require(value >= 0 && std::isfinite(value), name, value, "0 or more");
  };
  notNegative("DepthNoise::constant_m", noise.constant_m);
  notNegative("DepthNoise::quadratic_per_m", noise.quadratic_per_m);
  notNegative("DepthNoise::step_m", noise.step_m);
  notNegative("DepthNoise::bias_m", noise.bias_m);
  notNegative("DepthNoise::bias_fraction", noise.bias_fraction);
  require(noise.correlation_px >= 1 && std::isfinite(noise.correlation_px),
          "DepthNoise::correlation_px", noise.correlation_px, "1 or more");
  require(noise.constant_m + noise.quadratic_per_m > 0, "DepthNoise::constant_m", noise.constant_m,
          "above 0, or quadratic_per_m");
}

std::shared_ptr<const DepthImage> depthImage(ImageOf<float> metres, const Camera& camera,
                                             const Pose& T_C_D, const DepthNoise& noise) {
  return keptDepth(std::move(metres), depthOf(DepthImage::Format::kFloat, camera, T_C_D, noise));
}

std::shared_ptr<const DepthImage> depthImage(ImageOf<std::uint16_t> millimetres,
                                             const Camera& camera, const Pose& T_C_D,
                                             const DepthNoise& noise) {
  return keptDepth(std::move(millimetres),
                   depthOf(DepthImage::Format::kUint16, camera, T_C_D, noise));
}

}  // namespace nerf_pose_refiner
