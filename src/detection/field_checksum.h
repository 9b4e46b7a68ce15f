// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <type_traits>

#include "field/field.h"
#include "math/checksum.h"

namespace nerf_pose_refiner {

static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__,
              "numbers are written as they lie in memory");

template <typename T>
void addTo(const T& value, Checksum* checksum) {
  static_assert(std::is_arithmetic<T>::value, "bytes between members are random");
  checksum->add(&value, sizeof value);
}

/// What a field looks like, and how large.
inline void addTo(const Field& field, Checksum* checksum) {
  checksum->add(field.grid.data(), field.grid.size() * sizeof(std::uint16_t));
  checksum->add(field.density_weights.data(), field.density_weights.size() * sizeof(float));
  checksum->add(field.colour_weights.data(), field.colour_weights.size() * sizeof(float));
  checksum->add(field.occupancy.bits.data(), field.occupancy.bits.size());
  addTo(field.metadata.diameter, checksum);
}

}  // namespace nerf_pose_refiner
