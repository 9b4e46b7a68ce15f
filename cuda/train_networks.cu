// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "hash_gradient.cuh"
#include "launch.cuh"
#include "networks.cuh"
#include "train.h"

// Samples of a training step, in any order: forward, and forward and back with the gradients of
// weights and table. Weights' gradients are products over a block's samples, on the tensor cores.

namespace nerf_pose_refiner {
namespace {

constexpr int kForwardThreads = 128;
constexpr int kLearnThreads = 128;
constexpr int kUnitSums = 256;  // of 16 x 16 weights

/// Bytes of shared memory of a block that learns: weights; sums of their gradients; by warp, what
/// goes back and where activations are positive; the planes.
struct LearnLayout {
  int weight_bytes, sum_bytes, warp_bytes;

  __host__ __device__ explicit LearnLayout(const NetworkLayers& layers) {
    const CudaNetworkShape& shape = layers.shape;
    weight_bytes =
        (shape.forwardTiles() + shape.backwardTiles()) * 32 * static_cast<int>(sizeof(WeightPair));
    sum_bytes = layers.weights() * static_cast<int>(sizeof(float));
    warp_bytes = 32 * static_cast<int>(sizeof(float4)) + shape.hiddenLayers() * 2 * 32 * 4 +
                 32 * 2 * TrainingPlanes::halvesPerSample(layers);
  }
  __host__ __device__ int blockBytes() const { return weight_bytes + sum_bytes; }
};

/// A block that learns, and the calling warp in it.
struct LearningBlock {
  WarpMemory memory;
  float* sums;  ///< gradients of the weights so far, [16 x 16 weights][kUnitSums]
};

__device__ LearningBlock enterLearning(const CudaFieldView& field, const NetworkLayers& layers) {
  extern __shared__ uint4 shared_memory[];
  const LearnLayout layout(layers);
  const int warps = static_cast<int>(blockDim.x / 32), warp = static_cast<int>(threadIdx.x / 32);
  const CudaNetworkShape& shape = layers.shape;
  char* at = reinterpret_cast<char*>(shared_memory);
  uint2* weights = reinterpret_cast<uint2*>(at);
  const int forward = shape.forwardTiles() * 32;
  for (int i = threadIdx.x; i < forward + shape.backwardTiles() * 32; i += blockDim.x) {
    const WeightPair w = i < forward ? field.forward[i] : field.transposed[i - forward];
    weights[i] = make_uint2(w.x, w.y);
  }
  at += layout.weight_bytes;
  LearningBlock block;
  block.sums = reinterpret_cast<float*>(at);
  for (int i = threadIdx.x; i < layers.weights(); i += blockDim.x) block.sums[i] = 0;
  at += layout.sum_bytes;
  WarpMemory& memory = block.memory;
  memory.forward = weights;
  memory.transposed = weights + forward;
  memory.out = reinterpret_cast<float4*>(at) + 32 * warp;
  at += warps * 32 * static_cast<int>(sizeof(float4));
  memory.masks = reinterpret_cast<std::uint32_t*>(at) + shape.hiddenLayers() * 2 * 32 * warp;
  at += warps * shape.hiddenLayers() * 2 * 32 * 4;
  memory.planes = {reinterpret_cast<__half*>(at), 32 * warps, layers};
  memory.stride = memory.planes.inputStride(0);
  memory.encoding = memory.planes.inputs(0) + 32 * warp * memory.stride;
  memory.slopes = nullptr;
  const int colour = shape.density_hidden + 1;
  memory.harmonics = memory.planes.inputs(colour) + 32 * warp * memory.planes.inputStride(colour) +
                     16;  // behind the geometry features
  memory.lane = threadIdx.x % 32;
  __syncthreads();
  return block;
}

/// Adds the products of gradients and inputs over the block's samples to the weights' sums. Warps
/// share the 16 x 16 parts of all layers, which are theirs alone. All threads of a block take part.
__device__ void addWeightGradients(const TrainingPlanes& planes, float* sums) {
  const int lane = threadIdx.x % 32, warps = static_cast<int>(blockDim.x / 32);
  const int row = lane % 8, quarter = lane / 8;
  int turn = static_cast<int>(threadIdx.x / 32);  // parts until this warp's next
  for (int layer = 0; layer < planes.layers.count(); ++layer) {
    const int parts_in = planes.layers.inputs(layer) / 16;
    const int parts = parts_in * (planes.layers.outputs(layer) / 16);
    const int input_stride = planes.inputStride(layer);
    const int gradient_stride = planes.gradientStride(layer);
    const __half* gradients =
        planes.gradients(layer) + (row + quarter / 2 * 8) * gradient_stride + quarter % 2 * 8;
    const __half* inputs =
        planes.inputs(layer) + (row + quarter % 2 * 8) * input_stride + quarter / 2 * 8;
    for (; turn < parts; turn += warps) {
      const __half* a_address = gradients + turn / parts_in * 16;
      const __half* b_address = inputs + turn % parts_in * 16;
      float low[4] = {0, 0, 0, 0}, high[4] = {0, 0, 0, 0};
      for (int s = 0; s < planes.samples; s += 16) {
        std::uint32_t a[4], b[4];
        loadTransposed(a, a_address + s * gradient_stride);
        loadTransposed(b, b_address + s * input_stride);
        multiplyTile(low, a, make_uint2(b[0], b[1]));
        multiplyTile(high, a, make_uint2(b[2], b[3]));
      }
      float4* to = reinterpret_cast<float4*>(sums + turn * kUnitSums);
      const float4 l = to[lane], h = to[32 + lane];
      to[lane] = make_float4(l.x + low[0], l.y + low[1], l.z + low[2], l.w + low[3]);
      to[32 + lane] = make_float4(h.x + high[0], h.y + high[1], h.z + high[2], h.w + high[3]);
    }
    turn -= parts;
    sums += parts * kUnitSums;
  }
}

/// Adds a block's sums to the gradient of all weights. @return whether the thread's are finite.
__device__ bool giveWeightGradients(const NetworkLayers& layers, const float* sums,
                                    float* gradient) {
  bool finite = true;
  for (int layer = 0; layer < layers.count(); ++layer) {
    const int inputs = layers.inputs(layer), weights = inputs * layers.outputs(layer);
    const int parts_in = inputs / 16;
    for (int i = threadIdx.x; i < weights; i += blockDim.x) {
      // Element e of lane 4 g + t of half h: row g + 8 (e / 2), column 8 h + 2 t + e % 2.
      const int part = i / kUnitSums, e = i % 4, lane = i / 4 % 32, half = i % kUnitSums / 128;
      const int o = part / parts_in * 16 + lane / 4 + 8 * (e / 2);
      const int k = part % parts_in * 16 + 8 * half + 2 * (lane % 4) + e % 2;
      finite = finite && isfinite(sums[i]);
      if (sums[i] != 0) atomicAdd(gradient + o * inputs + k, sums[i]);
    }
    sums += weights;
    gradient += weights;
  }
  return finite;
}

/// A sample's position and direction; for lanes without one, those of no consequence.
struct SampleInput {
  float p[3] = {0.5f, 0.5f, 0.5f};
  float d[3] = {0, 0, 1};

  __device__ SampleInput(const TrainingTask& task, bool valid, unsigned i) {
    if (!valid) return;
    const float4 point = task.points[i];
    p[0] = point.x;
    p[1] = point.y;
    p[2] = point.z;
    const unsigned ray = task.point_rays[i];
    if (ray == kNoRay) return;
#pragma unroll
    for (int a = 0; a < 3; ++a) d[a] = task.rays[ray].direction[a];
  }
};

/// Warps take 32 samples at a time.
template <int W>
__global__ void __launch_bounds__(kForwardThreads, 4)
    forwardKernel(const __grid_constant__ CudaFieldView field,
                  const __grid_constant__ TrainingTask task) {
  const WarpMemory memory = enterBlock(field, 1, false);
  WarpNetworks<W> networks(field.shape, memory);
  const unsigned count = min(task.clock->marched, task.room);
  unsigned first = (blockIdx.x * blockDim.x + threadIdx.x) / 32 * 32;
  for (; first < count; first += gridDim.x * blockDim.x) {
    const unsigned i = first + memory.lane;
    const SampleInput sample(task, i < count, i);
    encode<false>(field, sample.p, memory.row(), nullptr, 0);
    writeHarmonics(sample.d, field.sh_degree, memory.harmonics + memory.lane * kHarmonics);
    const float density = expf(fminf(networks.template density<false>(), 30.0f));
    const float3 rgb = networks.template colour<false>(1);
    if (i < count) task.values[i] = make_float4(rgb.x, rgb.y, rgb.z, density);
  }
}

/// Blocks take as many samples at a time as they have threads.
template <int W>
__global__ void __launch_bounds__(kLearnThreads, W == 32 ? 2 : 1)
    learnKernel(const __grid_constant__ CudaFieldView field,
                const __grid_constant__ TrainingTask task) {
  const LearningBlock block = enterLearning(field, task.layers);
  const WarpMemory& memory = block.memory;
  WarpNetworks<W, true> networks(field.shape, memory);
  const unsigned count = task.clock->learned;
  const float scale = task.clock->loss_scale;
  float* table = reinterpret_cast<float*>(task.table.gradient);
  bool finite = true;
  for (unsigned first = blockIdx.x * blockDim.x; first < count; first += gridDim.x * blockDim.x) {
    const unsigned i = first + threadIdx.x;
    const bool valid = i < count;
    const SampleInput sample(task, valid, valid ? task.learned[i] : 0);
    encode<false>(field, sample.p, memory.row(), nullptr, 0);
    writeHarmonics(sample.d, field.sh_degree, memory.harmonics + memory.lane * 40);
    networks.template density<true>();
    networks.template colour<true>(1);
    float4 g = valid ? task.gradients[i] : make_float4(0, 0, 0, 0);
    g = make_float4(scale * g.x, scale * g.y, scale * g.z, scale * g.w);
    networks.trainBackward(g, [&] {
      __syncthreads();
      addWeightGradients(memory.planes, block.sums);
      __syncthreads();
    });
    if (valid) finite = scatterGradient(field, sample.p, memory.row(), table) && finite;
    __syncwarp();
  }
  __syncthreads();
  finite = giveWeightGradients(task.layers, block.sums,
                               reinterpret_cast<float*>(task.weights.gradient)) &&
           finite;
  if (!finite) task.clock->broken = 1;
}

}  // namespace

void evaluateTrainingSamples(const CudaFieldView& field, const TrainingTask& task,
                             cudaStream_t stream) {
  const int bytes = SharedLayout(field.shape, 1, false).bytes(kForwardThreads / 32);
  launchPersistent(field.shape.width == 32 ? forwardKernel<32> : forwardKernel<64>, kForwardThreads,
                   bytes, stream, field, task);
}

void learnFromSamples(const CudaFieldView& field, const TrainingTask& task, cudaStream_t stream) {
  const LearnLayout layout(task.layers);
  const int threads = threadsThatFit(kLearnThreads, layout.blockBytes(), layout.warp_bytes);
  const auto kernel = field.shape.width == 32 ? learnKernel<32> : learnKernel<64>;
  launchPersistent(kernel, threads, layout.blockBytes() + threads / 32 * layout.warp_bytes, stream,
                   field, task);
}

}  // namespace nerf_pose_refiner
