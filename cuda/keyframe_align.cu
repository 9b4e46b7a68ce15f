// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "keyframe_align.h"

#include <cuda_runtime.h>

#include <algorithm>
#include <stdexcept>
#include <string>

#include "cuda_error.h"
#include "keyframe_start.cuh"

namespace nerf_pose_refiner {
namespace {

/// Blocks in crews.
__global__ void __launch_bounds__(kAlignThreads)
    alignKernel(const __grid_constant__ KeyframeAlignmentTask task,
                const __grid_constant__ KeyframeCrews crews) {
  extern __shared__ float4 row_memory[];
  __shared__ SharedSearch shared;
  StartAlignment(task, crews, &shared, row_memory).run();
}

int attributeOf(cudaDeviceAttr attribute) {
  int device = 0, value = 0;
  NPR_CUDA_CHECK(cudaGetDevice(&device));
  NPR_CUDA_CHECK(cudaDeviceGetAttribute(&value, attribute, device));
  return value;
}

int rowBytes(int row_cells) { return kRowPlanes * row_cells * static_cast<int>(sizeof(float4)); }

}  // namespace

KeyframeDevice keyframeDevice() {
  constexpr int kMaxBlocks = 8;  // of a cluster, on every device that has them
  // Decided by the architecture that the kernel was compiled for, not by the device: code for older
  // ones has no barrier of a cluster, on a newer device either.
  constexpr int kClusterArchitecture = 90;
  cudaFuncAttributes kernel;
  NPR_CUDA_CHECK(cudaFuncGetAttributes(&kernel, alignKernel));
  KeyframeDevice device;
  device.processors = attributeOf(cudaDevAttrMultiProcessorCount);
  device.most_blocks = kernel.ptxVersion >= kClusterArchitecture ? kMaxBlocks : 1;
  device.shared_bytes = attributeOf(cudaDevAttrMaxSharedMemoryPerBlockOptin) -
                        static_cast<int>(kernel.sharedSizeBytes);
  NPR_CUDA_CHECK(cudaFuncSetAttribute(alignKernel, cudaFuncAttributeMaxDynamicSharedMemorySize,
                                      device.shared_bytes));
  return device;
}

KeyframeCrews keyframeCrews(const KeyframeDevice& device, int starts, int window) {
  KeyframeCrews crews;
  crews.blocks = 1;
  while (crews.blocks < device.most_blocks && 2 * crews.blocks * starts <= device.processors) {
    crews.blocks *= 2;
  }
  crews.crews = std::min(starts, device.processors / crews.blocks);
  crews.row_cells = kRunCells + 2 * window;
  crews.row_warps = std::min(kAlignWarps, device.shared_bytes / rowBytes(crews.row_cells));
  if (crews.row_warps < 1) {
    throw std::runtime_error("CUDA: a keyframe's neighbourhoods of local colours, " +
                             std::to_string(window) + " cells to each side, are too large");
  }
  return crews;
}

void alignKeyframes(const KeyframeAlignmentTask& task, const KeyframeCrews& crews,
                    cudaStream_t stream) {
  const int bytes = crews.row_warps * rowBytes(crews.row_cells);
  cudaLaunchAttribute cluster = {};
  cluster.id = cudaLaunchAttributeClusterDimension;
  cluster.val.clusterDim.x = crews.blocks;
  cluster.val.clusterDim.y = cluster.val.clusterDim.z = 1;
  cudaLaunchConfig_t launch = {};
  launch.gridDim = crews.blocks * crews.crews;
  launch.blockDim = kAlignThreads;
  launch.dynamicSmemBytes = bytes;
  launch.stream = stream;
  launch.attrs = &cluster;
  launch.numAttrs = crews.blocks > 1 ? 1 : 0;
  NPR_CUDA_CHECK(cudaLaunchKernelEx(&launch, alignKernel, task, crews));
}

}  // namespace nerf_pose_refiner
