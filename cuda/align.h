// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include "hypotheses.h"
#include "math/alignment_search.h"
#include "views.h"

namespace nerf_pose_refiner {

/// What every pose of a stage is compared with.
struct CudaAlignmentTarget {
  CudaCamera camera;
  /// Blurred image [h][w][2]; where there are regions, with confidence and inside as its point.
  const float4* observed;
  const float* weight;              ///< [h][w]
  const float* background_density;  ///< [h][w], where there are regions
  ComparisonRules rules;
  bool fit_gain_bias;
};

/// The searches of a stage and their scratch memory, all on the device.
struct CudaSearches {
  AlignmentSearch* searches;  ///< [views]
  CameraPose<double>* poses;  ///< [views], to be rendered next
  int* active;                ///< [views], 0: done
  double* partial_sums;       ///< [views][alignmentChunks][kAlignmentSums]
  int view_count;             ///< at least as many as there are hypotheses
};

constexpr int kAlignmentSums = 34;  // numbers of AlignmentSumsOf

/// Parts of an image that are summed apart.
int alignmentChunks(const CudaCamera& camera);

/// Starts a search from every live hypothesis; flags those that cannot be optimised.
void startSearches(const CudaSearches& searches, const CudaHypotheses& batch,
                   const AlignmentRules& rules, cudaStream_t stream);

/// Fits gain and bias of the trials to their blurred images, from where they are: one pass.
void fitGainBiases(const CudaAlignmentTarget& target, const CudaSearches& searches,
                   const float4* images, cudaStream_t stream);

/// Sums residuals of the trials' blurred images and takes one step with every search; if
/// `only_score`, takes the sums as they are and ends the searches.
void advanceSearches(const CudaAlignmentTarget& target, const CudaSearches& searches,
                     const float4* images, const AlignmentRules& rules, bool only_score,
                     cudaStream_t stream);

/// Writes what the searches found to their hypotheses. @param by_contrast how their score is taken,
/// @see scoreOf.
void finishSearches(const CudaSearches& searches, const CudaHypotheses& batch, bool by_contrast,
                    cudaStream_t stream);

}  // namespace nerf_pose_refiner
