// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "field/object_metadata.h"
#include "nerf_pose_refiner/depth.h"
#include "nerf_pose_refiner/image.h"
#include "tools/refine_case.h"
#include "tools/tool.h"

namespace nerf_pose_refiner {

/// The depth image of a command, and its errors.
struct DepthOptions {
  std::string file;  ///< PNG of 16-bit grey; empty: there is none
  double unit_m = 0.001;
  std::vector<double> noise = {DepthNoise().constant_m, DepthNoise().quadratic_per_m};
  std::vector<double> bias = {DepthNoise().bias_m, DepthNoise().bias_fraction};

  /// @return the option of the file.
  CLI::Option* addTo(CLI::App* app, const std::string& help);

  /// @throws std::invalid_argument if the object has no scale to compare depth with,
  /// std::runtime_error naming the file.
  ImageOf<std::uint16_t> read(const FieldMetadata& object) const;

  /// Gives it to a case that has its camera. @throws as addDepth.
  void giveTo(ImageOf<std::uint16_t> values, RefineCase* input) const;
};

/// What became of it, for JSON.
nlohmann::json depthJson(const DepthReport& depth);

}  // namespace nerf_pose_refiner
