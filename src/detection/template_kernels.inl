// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
//
// Scores of templates, compiled once per instruction set by the cpp files that include this; the
// rules of backend/cpu/cpu_kernels.inl hold.

#include <stdint.h>
#include <string.h>

#include "detection/template_kernels.h"

namespace nerf_pose_refiner {
namespace {

#if defined(__AVX2__)
constexpr int kLanes = 32;
#else
constexpr int kLanes = 16;
#endif
typedef uint8_t Bytes __attribute__((vector_size(kLanes)));
typedef int16_t Words __attribute__((vector_size(2 * kLanes)));

/// Sum over the edges of one part, for as many positions as there are lanes.
inline void sumPart(const uint8_t* place, const int32_t* offset, int edges, Words* sum) {
  *sum = Words{};
  for (int e = 0; e < edges; e += kEdgesPerSum) {
    Bytes few = {};
    for (int k = 0; k < kEdgesPerSum; ++k) {
      Bytes responses;
      memcpy(&responses, place + offset[e + k], sizeof responses);
      few += responses;
    }
    *sum += __builtin_convertvector(few, Words);
  }
}

void score(const ScoreArea& area, const EdgeOffsets& edges, int16_t* scores) {
  const int columns = area.runs * kScoreRun;
  for (int row = 0; row < area.rows; ++row) {
    const uint8_t* const places = area.first + (int64_t)row * area.row_step;
    for (int column = 0; column < columns; column += kLanes) {
      const uint8_t* const place = places + column;
      Words sum, of_part;
      sumPart(place, edges.offset, edges.per_part, &sum);
      Words least = sum;
      for (int part = 1; part < kTemplateParts; ++part) {
        sumPart(place, edges.offset + part * edges.per_part, edges.per_part, &of_part);
        sum += of_part;
        least = of_part < least ? of_part : least;
      }
      sum -= least;
      memcpy(scores + (int64_t)row * columns + column, &sum, sizeof sum);
    }
  }
}

}  // namespace
}  // namespace nerf_pose_refiner
