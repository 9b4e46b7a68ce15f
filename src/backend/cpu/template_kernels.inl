// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Scores of templates, compiled once per instruction set by the cpp files that include this; the
// rules of backend/cpu/cpu_kernels.inl hold.

#include <stdint.h>
#include <string.h>

#include "backend/cpu/template_kernels.h"

namespace nerf_pose_refiner {
namespace {

#if defined(__AVX2__)
constexpr int kLanes = 32;
#else
constexpr int kLanes = 16;
#endif
typedef uint8_t Bytes __attribute__((vector_size(kLanes)));
typedef uint16_t Words __attribute__((vector_size(kLanes)));

/// Sums at as many positions as there are lanes. Bytes become words in place, the two halves of
/// each word: to widen a vector would cross its lanes.
struct Sums {
  Words low, high;  ///< at even positions, at odd ones (of little-endian processors)
};

/// Sum over the features of one part.
inline Sums sumPart(const uint8_t* place, const int32_t* offset, int features) {
  Sums sum = {};
  for (int e = 0; e < features; e += kFeaturesPerSum) {
    Bytes few = {};
    for (int k = 0; k < kFeaturesPerSum; ++k) {
      Bytes responses;
      memcpy(&responses, place + offset[e + k], sizeof responses);
      few += responses;
    }
    const Words both = (Words)few;
    sum.low += both & 0xff;
    sum.high += both >> 8;
  }
  return sum;
}

inline Words lesser(Words a, Words b) { return a < b ? a : b; }

/// Of all parts but the least one.
inline Sums sumBest(const uint8_t* place, const FeatureOffsets& features) {
  Sums sum = sumPart(place, features.offset, features.per_part), least = sum;
  for (int part = 1; part < kTemplateParts; ++part) {
    const Sums of_part =
        sumPart(place, features.offset + part * features.per_part, features.per_part);
    sum.low += of_part.low;
    sum.high += of_part.high;
    least.low = lesser(of_part.low, least.low);
    least.high = lesser(of_part.high, least.high);
  }
  return {sum.low - least.low, sum.high - least.high};
}

void score(const ScoreArea& area, const FeatureOffsets& features, int16_t* scores) {
  const int columns = area.runs * kScoreRun;
  for (int row = 0; row < area.rows; ++row) {
    const uint8_t* const places = area.first + (int64_t)row * area.row_step;
    int16_t* const here = scores + (int64_t)row * columns;
    for (int column = 0; column < columns; column += kLanes) {
      const Sums sum = sumBest(places + column, features);
      for (int k = 0; k < kLanes / 2; ++k) {
        here[column + 2 * k] = (int16_t)sum.low[k];
        here[column + 2 * k + 1] = (int16_t)sum.high[k];
      }
    }
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
