// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>

#include "support/random_field.h"

namespace nerf_pose_refiner {

/// A field of a few hundred numbers with an occupancy grid, for tests of files and checks.
inline Field smallField() {
  FieldConfig config;
  config.profile = "small";
  config.levels = 2;
  config.features = 2;
  config.log2_table_size = 8;
  config.base_resolution = 4;
  config.finest_resolution = 8;
  config.density_width = 8;
  config.geometry_features = 3;
  config.colour_width = 8;
  config.sh_degree = 2;
  config.occupancy_resolution = 8;
  Field field = randomField(config, 1);
  field.occupancy.resolution = 8;
  for (int i = 0; i < 64; ++i) {
    field.occupancy.bits.push_back(static_cast<std::uint8_t>(37 * i + 11));
  }
  return field;
}

}  // namespace nerf_pose_refiner
