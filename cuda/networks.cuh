// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "hash_encoding.cuh"
#include "nerf_pose_refiner/maths/spherical_harmonics.h"
#include "warp_tiles.cuh"

namespace nerf_pose_refiner {

constexpr int kHarmonics = 16;

/// What a warp that evaluates the networks keeps in shared memory, for 32 samples.
struct WarpMemory {
  const uint2* forward;     ///< all warps' weights
  const uint2* transposed;  ///< null if there is no way back
  __half* encoding;         ///< [32][stride]; on the way back its gradient
  __half* slopes;           ///< [3][32][stride]
  __half* harmonics;        ///< [32 / samples of a ray][16], of the rays
  float4* out;              ///< [32]
  std::uint32_t* masks;     ///< [hidden layers][2][32]: where activations are positive
  int stride;               ///< of a row: eight halves more than it holds, against bank conflicts
  int lane;

  __device__ __half* row() const { return encoding + lane * stride; }
  __device__ __half* slopeRow() const { return slopes + lane * stride; }
  __device__ int slopePlane() const { return 32 * stride; }
};

/// Bytes of shared memory, in the order weights, then each warp's own.
struct SharedLayout {
  int weight_bytes, warp_bytes;
  int stride;
  bool backward;

  __host__ __device__ SharedLayout(const CudaNetworkShape& shape, int samples_per_ray,
                                   bool with_backward)
      : stride(16 * shape.encoding_tiles + 8), backward(with_backward) {
    const int tiles = shape.forwardTiles() + (backward ? shape.backwardTiles() : 0);
    weight_bytes = tiles * 32 * static_cast<int>(sizeof(WeightPair));
    warp_bytes = 32 * stride * 2 * (backward ? 4 : 1) + 32 / samples_per_ray * kHarmonics * 2 +
                 32 * static_cast<int>(sizeof(float4)) +
                 (backward ? shape.hiddenLayers() * 2 * 32 * 4 : 0);
  }
  __host__ __device__ int bytes(int warps) const { return weight_bytes + warps * warp_bytes; }
};

/// Copies the weights into shared memory and deals the rest to the warps. All threads of a block.
__device__ inline WarpMemory enterBlock(const CudaFieldView& field, int samples_per_ray,
                                        bool backward) {
  extern __shared__ uint4 shared_memory[];
  const SharedLayout layout(field.shape, samples_per_ray, backward);
  uint2* weights = reinterpret_cast<uint2*>(shared_memory);
  const int forward = field.shape.forwardTiles() * 32;
  const int all = layout.weight_bytes / static_cast<int>(sizeof(uint2));
  for (int i = threadIdx.x; i < all; i += blockDim.x) {
    const WeightPair w = i < forward ? field.forward[i] : field.transposed[i - forward];
    weights[i] = make_uint2(w.x, w.y);
  }
  WarpMemory memory;
  char* own = reinterpret_cast<char*>(shared_memory) + layout.weight_bytes +
              threadIdx.x / 32 * layout.warp_bytes;
  memory.forward = weights;
  memory.transposed = backward ? weights + forward : nullptr;
  memory.stride = layout.stride;
  memory.out = reinterpret_cast<float4*>(own);
  memory.harmonics = reinterpret_cast<__half*>(memory.out + 32);
  memory.encoding = memory.harmonics + 32 / samples_per_ray * kHarmonics;
  memory.slopes = memory.encoding + 32 * layout.stride;
  memory.masks = reinterpret_cast<std::uint32_t*>(memory.slopes + 3 * 32 * layout.stride);
  memory.lane = threadIdx.x % 32;
  __syncthreads();
  return memory;
}

/// Writes the harmonics of a ray's direction (which is the same in N and O).
__device__ inline void writeHarmonics(const float direction[3], int degree, __half* to) {
  float h[kHarmonics] = {};
  sphericalHarmonics(direction[0], direction[1], direction[2], degree, h);
  reinterpret_cast<uint4*>(to)[0] = packEight(h);
  reinterpret_cast<uint4*>(to)[1] = packEight(h + 8);
}

/// The two networks of a field for a warp's 32 samples, hidden layers W wide. Every lane holds a
/// sample; all lanes must take part in every call.
template <int W>
class WarpNetworks {
 public:
  static constexpr int NT = W / 8, KT = W / 16;  // tiles of neurons, as outputs and as inputs
  static constexpr int kPart = 4;                // tiles that are summed at a time

  __device__ WarpNetworks(const CudaNetworkShape& shape, const WarpMemory& memory)
      : shape_(shape), memory_(memory) {}

  /// From the encoding's rows. @return the logit of the lane's density; geometry features stay
  /// here.
  template <bool kKeep>
  __device__ float density() {
    __syncwarp();
    const uint2* weights = memory_.forward;
    const int lane = memory_.lane;
    TileInputs<KT> in = hiddenLayer<kKeep>(0, [&](int n, TileSums<kPart>* sums) {
      const __half* address = memory_.encoding + lane % 16 * memory_.stride + lane / 16 * 8;
      for (int k = 0; k < shape_.encoding_tiles; ++k, address += 16) {
        std::uint32_t a0[4], a1[4];
        loadTile(a0, address);
        loadTile(a1, address + 16 * memory_.stride);
        multiplyInputs(a0, a1, weights + (k * NT + n) * 32, lane, sums);
      }
    });
    weights += shape_.encoding_tiles * NT * 32;
    for (int l = 1; l < shape_.density_hidden; ++l, weights += KT * NT * 32) {
      in = hiddenLayer<kKeep>(l, fromRegisters(in, weights));
    }
    TileSums<2> last;
    multiplyLayer(in, weights, lane, &last);
    colour_weights_ = weights + KT * 2 * 32;
    // Column 0 is the logit: it goes to its sample's lane, and is no input of the colour.
    if (lane % 4 == 0) {
#pragma unroll
      for (int m = 0; m < 2; ++m) {
        memory_.out[16 * m + lane / 4].w = last.c[m][0][0];
        memory_.out[16 * m + lane / 4 + 8].w = last.c[m][0][2];
        last.c[m][0][0] = last.c[m][0][2] = 0;
      }
    }
    geometry_ = toInputs(last);
    __syncwarp();
    return memory_.out[lane].w;
  }

  /// After density, with the rays' harmonics in place: the lane's colour, sRGB-encoded.
  /// @param samples_per_ray lanes that share a row of harmonics.
  template <bool kKeep>
  __device__ float3 colour(int samples_per_ray) {
    const int lane = memory_.lane;
    const uint2* weights = colour_weights_;
    TileInputs<KT> in =
        hiddenLayer<kKeep>(shape_.density_hidden, [&](int n, TileSums<kPart>* sums) {
          multiplyInputs(geometry_.a[0][0], geometry_.a[1][0], weights + n * 32, lane, sums);
          const __half* harmonics = memory_.harmonics + lane / 16 * 8;
          std::uint32_t a0[4], a1[4];
          loadTile(a0, harmonics + lane % 16 / samples_per_ray * kHarmonics);
          loadTile(a1, harmonics + (16 + lane % 16) / samples_per_ray * kHarmonics);
          multiplyInputs(a0, a1, weights + (NT + n) * 32, lane, sums);
        });
    weights += 2 * NT * 32;
    for (int l = 1; l < shape_.colour_hidden; ++l, weights += KT * NT * 32) {
      in = hiddenLayer<kKeep>(shape_.density_hidden + l, fromRegisters(in, weights));
    }
    TileSums<1> last;
    multiplyLayer(in, weights, lane, &last);
    if (lane % 4 < 2) {
#pragma unroll
      for (int m = 0; m < 2; ++m) {
#pragma unroll
        for (int i = 0; i < 4; ++i) {
          // Columns 2 t and 2 t + 1 of rows g and g + 8; there are three colours.
          float* to = &memory_.out[16 * m + lane / 4 + 8 * (i / 2)].x;
          if (lane % 4 == 0) to[i % 2] = last.c[m][0][i];
          if (lane % 4 == 1 && i % 2 == 0) to[2] = last.c[m][0][i];
        }
      }
    }
    __syncwarp();
    const float4 logits = memory_.out[lane];
    return {sigmoid(logits.x), sigmoid(logits.y), sigmoid(logits.z)};
  }

  /// The way back, after density<true> and colour<true>: from the derivatives of the lane's colour
  /// logits (x, y, z) and density logit (w) to its encoding, whose row gets the gradient.
  /// @param harmonics_gradient null, or the lane's 16 numbers.
  __device__ void backward(const float4& gradient, float* harmonics_gradient) {
    const int lane = memory_.lane;
    __syncwarp();
    memory_.out[lane] = gradient;
    __syncwarp();
    const uint2* weights = memory_.transposed;
    TileInputs<1> top = colourGradient();
    TileInputs<KT> in = hiddenGradient(shape_.hiddenLayers() - 1, fromRegisters(top, weights));
    weights += NT * 32;
    for (int l = shape_.colour_hidden - 2; l >= 0; --l, weights += KT * NT * 32) {
      in = hiddenGradient(shape_.density_hidden + l, fromRegisters(in, weights));
    }
    if (harmonics_gradient) harmonicsGradient(in, weights, harmonics_gradient);
    TileSums<2> geometry;
    clearSums(&geometry);
#pragma unroll
    for (int k = 0; k < KT; ++k) {
      multiplyInputs(in.a[0][k], in.a[1][k], weights + k * 4 * 32, lane, &geometry);
    }
    weights += KT * 4 * 32;
    if (lane % 4 == 0) {
#pragma unroll
      for (int m = 0; m < 2; ++m) {
        geometry.c[m][0][0] = memory_.out[16 * m + lane / 4].w;
        geometry.c[m][0][2] = memory_.out[16 * m + lane / 4 + 8].w;
      }
    }
    top = toInputs(geometry);
    in = hiddenGradient(shape_.density_hidden - 1, fromRegisters(top, weights));
    weights += NT * 32;
    for (int l = shape_.density_hidden - 2; l >= 0; --l, weights += KT * NT * 32) {
      in = hiddenGradient(l, fromRegisters(in, weights));
    }
    encodingGradient(in, weights);
  }

 private:
  __device__ static float sigmoid(float x) { return 1.0f / (1.0f + expf(-x)); }

  /// Products with inputs that stand in registers, for hiddenLayer and hiddenGradient.
  template <int K>
  struct FromRegisters {
    const TileInputs<K>& in;
    const uint2* weights;
    int lane;

    __device__ void operator()(int n, TileSums<kPart>* sums) const {
#pragma unroll
      for (int k = 0; k < K; ++k) {
        multiplyInputs(in.a[0][k], in.a[1][k], weights + (k * NT + n) * 32, lane, sums);
      }
    }
  };
  template <int K>
  __device__ FromRegisters<K> fromRegisters(const TileInputs<K>& in, const uint2* weights) const {
    return {in, weights, memory_.lane};
  }

  /// A hidden layer, a part of its neurons at a time: the sums of all would crowd the registers.
  /// If the way back is to come, remembers where the ReLU let through.
  /// @param multiply adds the products for the tiles from n on.
  template <bool kKeep, typename Multiply>
  __device__ TileInputs<KT> hiddenLayer(int layer, const Multiply& multiply) {
    TileInputs<KT> out;
    std::uint32_t bits[2] = {0, 0};
#pragma unroll
    for (int n = 0; n < NT; n += kPart) {
      TileSums<kPart> sums;
      clearSums(&sums);
      multiply(n, &sums);
      if (kKeep) addPositiveBits(sums, n, bits);
      applyRelu(&sums);
      placeInputs(sums, n / 2, &out);
    }
    if (kKeep) {
      memory_.masks[(layer * 2 + 0) * 32 + memory_.lane] = bits[0];
      memory_.masks[(layer * 2 + 1) * 32 + memory_.lane] = bits[1];
    }
    return out;
  }

  /// The way back through a hidden layer's ReLU.
  template <typename Multiply>
  __device__ TileInputs<KT> hiddenGradient(int layer, const Multiply& multiply) {
    TileInputs<KT> out;
    const std::uint32_t bits[2] = {memory_.masks[(layer * 2 + 0) * 32 + memory_.lane],
                                   memory_.masks[(layer * 2 + 1) * 32 + memory_.lane]};
#pragma unroll
    for (int n = 0; n < NT; n += kPart) {
      TileSums<kPart> sums;
      clearSums(&sums);
      multiply(n, &sums);
      applyBits(bits, n, &sums);
      placeInputs(sums, n / 2, &out);
    }
    return out;
  }

  /// Gradients of the colour logits as inputs of a layer: columns 0..2 of 16.
  __device__ TileInputs<1> colourGradient() const {
    TileInputs<1> top;
    const int t = memory_.lane % 4;
#pragma unroll
    for (int m = 0; m < 2; ++m) {
#pragma unroll
      for (int i = 0; i < 2; ++i) {
        const float4 g = memory_.out[16 * m + memory_.lane / 4 + 8 * i];
        top.a[m][0][i] = t == 0 ? packHalves(g.x, g.y) : t == 1 ? packHalves(g.z, 0.0f) : 0u;
      }
      top.a[m][0][2] = top.a[m][0][3] = 0;
    }
    return top;
  }

  /// The lane's gradient of the harmonics, through the encoding's rows, which are free by now.
  __device__ void harmonicsGradient(const TileInputs<KT>& in, const uint2* weights, float* out) {
    TileSums<2> sums;
    clearSums(&sums);
#pragma unroll
    for (int k = 0; k < KT; ++k) {
      multiplyInputs(in.a[0][k], in.a[1][k], weights + (k * 4 + 2) * 32, memory_.lane, &sums);
    }
    writeRows(sums, 0);
    __syncwarp();
#pragma unroll
    for (int i = 0; i < kHarmonics; ++i) out[i] = __half2float(memory_.row()[i]);
    __syncwarp();
  }

  /// Writes two tiles' sums as halves to columns [first, first + 16) of the encoding's rows.
  __device__ void writeRows(const TileSums<2>& sums, int first) {
    const int g = memory_.lane / 4, t = memory_.lane % 4;
#pragma unroll
    for (int m = 0; m < 2; ++m) {
#pragma unroll
      for (int n = 0; n < 2; ++n) {
        __half* to = memory_.encoding + (16 * m + g) * memory_.stride + first + 8 * n + 2 * t;
        const float* c = sums.c[m][n];
        *reinterpret_cast<std::uint32_t*>(to) = packHalves(c[0], c[1]);
        *reinterpret_cast<std::uint32_t*>(to + 8 * memory_.stride) = packHalves(c[2], c[3]);
      }
    }
  }

  /// First layer, back: two tiles of 8 inputs at a time.
  __device__ void encodingGradient(const TileInputs<KT>& in, const uint2* weights) {
    const int tiles = 2 * shape_.encoding_tiles;
    for (int pair = 0; pair < shape_.encoding_tiles; ++pair) {
      TileSums<2> sums;
      clearSums(&sums);
#pragma unroll
      for (int k = 0; k < KT; ++k) {
        multiplyInputs(in.a[0][k], in.a[1][k], weights + (k * tiles + 2 * pair) * 32, memory_.lane,
                       &sums);
      }
      writeRows(sums, 16 * pair);
    }
    __syncwarp();
  }

  const CudaNetworkShape& shape_;
  const WarpMemory& memory_;
  TileInputs<1> geometry_;       // outputs of the density network, without the logit
  const uint2* colour_weights_;  // where the colour network's begin
};

}  // namespace nerf_pose_refiner
