// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include <stdexcept>
#include <string>

#include "refinement/field_refiner.h"

namespace nerf_pose_refiner {
namespace {

void requireWidth(const char* name, double value, double most) {
  if (!(value >= 0 && value <= most)) {
    throw std::invalid_argument(std::string("Prior::") + name + " is " + std::to_string(value) +
                                ", must be 0.." + std::to_string(most));
  }
}

}  // namespace

void Prior::validate() const {
  if (!T_O_C.isFinite() || !T_O_C.isRigid()) {
    throw std::invalid_argument("Prior::T_O_C is not a rigid transform");
  }
  requireWidth("rotation_rad", rotation_rad, 3.15);
  requireWidth("translation", translation, 100);
}

bool Prior::isAsWideAs(const Prior& other) const {
  return rotation_rad == other.rotation_rad && translation == other.translation &&
         rotate_about_object == other.rotate_about_object;
}

}  // namespace nerf_pose_refiner
