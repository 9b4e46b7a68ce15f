// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "tools/depth_options.h"

#include <stdexcept>
#include <utility>

#include "image/io.h"

namespace nerf_pose_refiner {

CLI::Option* DepthOptions::addTo(CLI::App* app, const std::string& help) {
  CLI::Option* const depth = app->add_option("--depth", file, help)->check(CLI::ExistingFile);
  app->add_option("--depth-unit", unit_m, "Length that 1 stands for in --depth [m]")
      ->needs(depth)
      ->capture_default_str();
  app->add_option("--depth-noise", noise,
                  "Deviation of a pixel of --depth: at any distance [m], per square of it [1/m]")
      ->expected(2)
      ->needs(depth)
      ->capture_default_str();
  app->add_option("--depth-bias", bias,
                  "Deviation of the bias that all pixels share: at any distance [m], per distance")
      ->expected(2)
      ->needs(depth)
      ->capture_default_str();
  return depth;
}

ImageOf<std::uint16_t> DepthOptions::read(const FieldMetadata& object) const {
  if (!(object.metres_per_unit > 0)) {
    throw std::invalid_argument("the model has no scale, so depth cannot be compared with it");
  }
  return readDepthPng(file);
}

void DepthOptions::giveTo(ImageOf<std::uint16_t> values, RefineCase* input) const {
  DepthNoise errors;
  errors.constant_m = noise[0];
  errors.quadratic_per_m = noise[1];
  errors.bias_m = bias[0];
  errors.bias_fraction = bias[1];
  addDepth(std::move(values), unit_m, errors, input);
}

nlohmann::json depthJson(const DepthReport& depth) {
  const char* const names[] = {"none", "used", "refused"};
  return {{"use", names[static_cast<int>(depth.use)]},
          {"message", depth.message},
          {"agreeing", depth.agreeing},
          {"bias_m", depth.bias_m}};
}

}  // namespace nerf_pose_refiner
