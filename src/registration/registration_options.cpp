// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "registration/registration_options.h"

#include <cmath>
#include <stdexcept>

#include "field/field.h"

namespace nerf_pose_refiner {

void RegistrationOptions::validate() const {
  const auto require = [](bool good, const char* name, double value, const char* range) {
    if (!good) {
      throw std::invalid_argument(std::string(name) + " = " + std::to_string(value) +
                                  ": expected " + range);
    }
  };
  FieldConfig::named(profile);
  require(steps >= 1, "steps", steps, "at least 1");
  require(max_seconds >= 0, "max_seconds", max_seconds, "at least 0");
  require(target_psnr_db >= 0, "target_psnr_db", target_psnr_db, "at least 0");
  require(held_out >= 0, "held_out", held_out, "at least 0");
  require(threads >= 0, "threads", threads, "0 (all cores) or more");
  require(metres_per_unit >= 0 && std::isfinite(metres_per_unit), "metres_per_unit",
          metres_per_unit, "0 (as the dataset says) or more");
  constexpr int kMaxSamples = 1 << 24;  // backends count a few of them together in 32 bits
  require(samples_per_step >= 1024 && samples_per_step <= kMaxSamples, "samples_per_step",
          samples_per_step, "1024 to 16777216");
  require(learning_rate > 0 && std::isfinite(learning_rate), "learning_rate", learning_rate,
          "above 0");
  require(final_learning_rate_factor > 0 && final_learning_rate_factor <= 1,
          "final_learning_rate_factor", final_learning_rate_factor, "in (0, 1]");
}

}  // namespace nerf_pose_refiner
