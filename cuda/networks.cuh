// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include "warp_memory.cuh"
#include "warp_tiles.cuh"

namespace nerf_pose_refiner {

/// The two networks of a field for a warp's 32 samples, hidden layers W wide. Every lane holds a
/// sample; all lanes must take part in every call.
/// @tparam kTrain keeps what the weights' gradients are made of, one sample a ray.
template <int W, bool kTrain = false>
class WarpNetworks {
 public:
  static constexpr int NT = W / 8, KT = W / 16;  // tiles of neurons, as outputs and as inputs
  static constexpr int kPart = 4;                // tiles that are summed at a time
  /// Of the harmonics' rows; in training they are a part of the colour network's inputs.
  static constexpr int kHarmonicsStride = kTrain ? 40 : kHarmonics;

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
    if constexpr (kTrain) keepInputs(geometry_, shape_.density_hidden + 1);
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
          loadTile(a0, harmonics + lane % 16 / samples_per_ray * kHarmonicsStride);
          loadTile(a1, harmonics + (16 + lane % 16) / samples_per_ray * kHarmonicsStride);
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
    const uint2* weights;
    const TileInputs<KT> in = hiddenBackward(gradient, harmonics_gradient, &weights);
    encodingGradient(in, weights);
  }

  /// The same in training: block_work() uses the planes while they are whole, before the encoding's
  /// rows get the gradient. It may wait for the block.
  template <typename BlockWork>
  __device__ void trainBackward(const float4& gradient, const BlockWork& block_work) {
    const uint2* weights;
    const TileInputs<KT> in = hiddenBackward(gradient, nullptr, &weights);
    block_work();
    encodingGradient(in, weights);
  }

 private:
  /// Back to the first hidden layer; @param first_weights those of the layer before it.
  __device__ TileInputs<KT> hiddenBackward(const float4& gradient, float* harmonics_gradient,
                                           const uint2** first_weights) {
    const int lane = memory_.lane;
    __syncwarp();
    memory_.out[lane] = gradient;
    __syncwarp();
    const uint2* weights = memory_.transposed;
    TileInputs<1> top = colourGradient();
    if constexpr (kTrain) keepGradients(top, shape_.hiddenLayers() + 1);
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
    if constexpr (kTrain) keepGradients(top, shape_.density_hidden);
    in = hiddenGradient(shape_.density_hidden - 1, fromRegisters(top, weights));
    weights += NT * 32;
    for (int l = shape_.density_hidden - 2; l >= 0; --l, weights += KT * NT * 32) {
      in = hiddenGradient(l, fromRegisters(in, weights));
    }
    *first_weights = weights;
    return in;
  }

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
    // What a hidden layer of the colour network gives goes into the second layer behind it: the
    // density network's last one stands between.
    if constexpr (kTrain) keepInputs(out, layer + (layer < shape_.density_hidden ? 1 : 2));
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
    if constexpr (kTrain) keepGradients(out, layer + (layer < shape_.density_hidden ? 0 : 1));
    return out;
  }

  /// Into the block's planes: from the first column on, what goes into a layer of NetworkLayers.
  template <int K>
  __device__ void keepInputs(const TileInputs<K>& in, int layer) const {
    const int stride = memory_.planes.inputStride(layer);
    storeInputs(in, memory_.planes.inputs(layer) + firstRow() * stride, stride, memory_.lane);
  }
  /// The gradients of what comes out of it.
  template <int K>
  __device__ void keepGradients(const TileInputs<K>& gradients, int layer) const {
    const int stride = memory_.planes.gradientStride(layer);
    storeInputs(gradients, memory_.planes.gradients(layer) + firstRow() * stride, stride,
                memory_.lane);
  }
  /// Of the warp's samples among the block's.
  __device__ static int firstRow() { return threadIdx.x / 32 * 32; }

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
