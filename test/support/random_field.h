// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cmath>
#include <cstdint>

#include "field/field.h"
#include "math/half.h"
#include "math/random.h"

namespace nerf_pose_refiner {

/// A shape for tests of derivatives: dense and hashed levels, few samples on a ray.
inline FieldConfig smallConfig() {
  FieldConfig config;
  config.levels = 4;
  config.features = 2;
  config.log2_table_size = 11;
  config.base_resolution = 4;
  config.finest_resolution = 40;
  config.density_width = 16;
  config.colour_width = 16;
  config.step = 0.11f;
  return config;
}

/// A field of fog in all colours: every parameter random, in a box that is no cube.
inline Field randomField(const FieldConfig& config, std::uint64_t seed) {
  Field field;
  field.config = config;
  field.box.min = {-1.0, -0.6, 0.2};
  field.box.max = {1.3, 1.4, 1.9};

  std::uint64_t drawn = 0;
  const auto uniform = [&](double low, double high) {
    return static_cast<float>(low + (high - low) * randomUniform(seed, 1, drawn++));
  };
  const GridLevel last = gridLevels(config).back();
  field.grid.resize((std::size_t{last.offset} + last.entries) * config.features);
  for (std::uint16_t& value : field.grid) value = floatToHalf(uniform(-1, 1));

  const double spread = 2.4 / std::sqrt(static_cast<double>(config.density_width));
  field.density_weights.resize(densityWeightCount(config));
  for (float& w : field.density_weights) w = uniform(-spread, spread);
  field.colour_weights.resize(colourWeightCount(config));
  for (float& w : field.colour_weights) w = uniform(-spread, spread);

  // The weights of the density's logit: there are no biases, so a positive mean makes the fog
  // thick.
  const std::size_t outputs = static_cast<std::size_t>(1 + config.geometry_features);
  const std::size_t row = field.density_weights.size() - outputs * config.density_width;
  for (int i = 0; i < config.density_width; ++i) {
    field.density_weights[row + i] = uniform(-0.3 * spread, 1.3 * spread);
  }
  field.validate();
  return field;
}

}  // namespace nerf_pose_refiner
