// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "evaluate.h"

#include "launch.cuh"
#include "networks.cuh"

namespace nerf_pose_refiner {
namespace {

// One block fills a multiprocessor: its warps share the weights, and leave more memory to the
// cache.
constexpr int kThreads = 512;
constexpr int kBackwardThreads = 384;

/// Warps take 32 samples at a time, one after the other in a fixed order.
template <int W, bool kBackward>
__global__ void __launch_bounds__(kBackward ? kBackwardThreads : kThreads, 1)
    evaluateKernel(const __grid_constant__ CudaFieldView field,
                   const __grid_constant__ EvaluationTask task) {
  const WarpMemory memory = enterBlock(field, 1, kBackward);
  WarpNetworks<W> networks(field.shape, memory);
  const int stride = static_cast<int>(gridDim.x * blockDim.x);
  int first = static_cast<int>((blockIdx.x * blockDim.x + threadIdx.x) / 32) * 32;
  float p[3], d[3];
  const auto read = [&] {
    const std::size_t at = 3 * static_cast<std::size_t>(min(first + memory.lane, task.count - 1));
#pragma unroll
    for (int a = 0; a < 3; ++a) {
      p[a] = task.positions[at + a];
      d[a] = task.directions[at + a];
    }
  };
  if (first < task.count) read();
  while (first < task.count) {
    const int i = min(first + memory.lane, task.count - 1);
    const bool valid = first + memory.lane < task.count;
    encode<kBackward>(field, p, memory.row(), memory.slopeRow(), memory.slopePlane());
    writeHarmonics(d, field.sh_degree, memory.harmonics + memory.lane * kHarmonics);
    first += stride;
    if (first < task.count) read();  // on its way while the networks work
    const float density = expf(fminf(networks.template density<kBackward>(), 30.0f));
    const float3 rgb = networks.template colour<kBackward>(1);
    if (valid && task.values != nullptr) {
      task.values[i] = make_float4(rgb.x, rgb.y, rgb.z, density);
    }
    if (!kBackward) continue;
    float4 g = task.gradients[i];
    g = make_float4(g.x * rgb.x * (1 - rgb.x), g.y * rgb.y * (1 - rgb.y), g.z * rgb.z * (1 - rgb.z),
                    g.w * density);
    const float scale = fmaxf(fmaxf(fabsf(g.x), fabsf(g.y)), fmaxf(fabsf(g.z), fabsf(g.w)));
    const float inverse = scale > 1e-20f ? 1 / scale : 0.0f;  // of less there is no inverse
    networks.backward(make_float4(inverse * g.x, inverse * g.y, inverse * g.z, inverse * g.w),
                      nullptr);
    float gradient[3];
    positionGradient(field, memory.row(), memory.slopeRow(), memory.slopePlane(), gradient);
    if (!valid) continue;
    const std::size_t at = 3 * static_cast<std::size_t>(i);
    for (int a = 0; a < 3; ++a) task.position_gradients[at + a] = scale * gradient[a];
  }
}

}  // namespace

void evaluateSamples(const CudaFieldView& field, const EvaluationTask& task, cudaStream_t stream) {
  const bool backward = task.position_gradients != nullptr;
  const SharedLayout layout(field.shape, 1, backward);
  const bool narrow = field.shape.width == 32;
  if (backward) {
    const int threads = threadsThatFit(kBackwardThreads, layout.weight_bytes, layout.warp_bytes);
    launchPersistent(narrow ? evaluateKernel<32, true> : evaluateKernel<64, true>, threads,
                     layout.bytes(threads / 32), stream, field, task);
  } else {
    const int threads = threadsThatFit(kThreads, layout.weight_bytes, layout.warp_bytes);
    launchPersistent(narrow ? evaluateKernel<32, false> : evaluateKernel<64, false>, threads,
                     layout.bytes(threads / 32), stream, field, task);
  }
}

}  // namespace nerf_pose_refiner
