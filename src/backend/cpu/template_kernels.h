// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <string>

#include "math/template_score.h"

namespace nerf_pose_refiner {

/// Positions are scored in runs of so many along a row.
constexpr int kScoreRun = kTileColumns;

/// Where the responses to a template's features are: offsets from a position's own place in a
/// memory, part after part.
struct FeatureOffsets {
  const std::int32_t* offset;
  int per_part;  ///< a multiple of kFeaturesPerSum, at most 512
};

/// Positions to be scored, in a memory of responses 0..kMaxResponse in which positions of a row
/// follow each other.
struct ScoreArea {
  const std::uint8_t* first;  ///< place of the first position
  std::int32_t row_step;      ///< from a position to the one below it
  int rows;
  int runs;  ///< of kScoreRun positions along each row
};

/// A template's score at each position: the sum of the responses at its features, without those of
/// the part where it is least. Whole numbers: all instruction sets give the same.
struct TemplateKernels {
  /// @param scores [rows][runs * kScoreRun]
  void (*score)(const ScoreArea& area, const FeatureOffsets& features, std::int16_t* scores);
};

/// Kernels for any processor, and for x86-64 with AVX2 (not defined where not compiled).
const TemplateKernels* baselineTemplateKernels();
const TemplateKernels* avx2TemplateKernels();

/// The instruction set is chosen as for the field. @throws as selectCpuKernels.
const TemplateKernels& selectTemplateKernels(const std::string& instruction_set);

}  // namespace nerf_pose_refiner
