// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cuda_runtime_api.h>

#include <cstdint>

#include "math/orientation_response.h"
#include "math/resample_taps.h"
#include "math/template_placement.h"

namespace nerf_pose_refiner {

/// Room for an image's gradients while its responses are made, for up to so many pixels.
struct ResponseScratch {
  float* colours;            ///< [pixels][3]
  float* smooth;             ///< [pixels][3]
  EdgeGradient* gradients;   ///< [pixels]
  std::uint8_t* agreements;  ///< [kOrientations][pixels]
  unsigned* counts;          ///< [1 << kLengthBits]
  float* half;               ///< length of a gradient that counts half
};

/// How a reduced image responds to orientations, in the memory of the device.
struct ResponseTask {
  const float* image;                 ///< [from_rows.size][from_columns.size][3]
  ImageAxis from_columns, from_rows;  ///< of its camera
  ImageAxis columns, rows;            ///< of the reduced image's
  DoubledDirection directions[kOrientations];
  ResponseOrder order;
  std::uint8_t* responses;  ///< [order.size()], 0 where they are not set
  ResponseScratch scratch;
};

/// Enqueues it. The same bits as ResponseMemory has.
void makeResponses(const ResponseTask& task, cudaStream_t stream);

}  // namespace nerf_pose_refiner
