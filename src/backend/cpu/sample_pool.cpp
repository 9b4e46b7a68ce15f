// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/sample_pool.h"

#include <algorithm>
#include <cstdint>
#include <cstring>

namespace nerf_pose_refiner {
namespace {

constexpr int kStride = TiledRows::kTileStride;

std::vector<TiledRows> makeRows(const std::vector<CpuLayer>& layers, int capacity) {
  std::vector<TiledRows> rows;
  for (const CpuLayer& layer : layers) rows.emplace_back(layer.inputs, capacity);
  rows.emplace_back(layers.back().outputs, capacity);
  return rows;
}

/// All layers for columns of one tile.
void forwardTile(const CpuKernels& kernels, const std::vector<CpuLayer>& layers,
                 std::vector<TiledRows>* activations, int first, int count) {
  for (std::size_t l = 0; l < layers.size(); ++l) {
    kernels.layer(layers[l].weights.data(), layers[l].outputs, layers[l].inputs,
                  (*activations)[l].at(first), (*activations)[l + 1].at(first), count, kStride,
                  layers[l].relu);
  }
}

void backwardLayers(const CpuKernels& kernels, const std::vector<CpuLayer>& layers,
                    const std::vector<TiledRows>& activations, std::vector<TiledRows>* gradients,
                    int first, int count, std::vector<float>* weight_gradients) {
  for (int l = static_cast<int>(layers.size()) - 1; l >= 0; --l) {
    const CpuLayer& layer = layers[l];
    float* out = (*gradients)[l + 1].at(first);
    if (layer.relu) {
      kernels.reluGradient(activations[l + 1].at(first), out, layer.outputs, count, kStride);
    }
    if (weight_gradients) {
      kernels.layerWeightGradient(layer.outputs, layer.inputs, out, activations[l].at(first), count,
                                  kStride, weight_gradients[l].data());
    }
    kernels.layer(layer.transposed.data(), layer.inputs, layer.outputs, out,
                  (*gradients)[l].at(first), count, kStride, false);
  }
}

}  // namespace

TiledRows::TiledRows(int rows, int columns)
    : rows_(rows),
      storage_(static_cast<std::size_t>((columns + kTile - 1) / kTile) * rows * kTileStride + 16,
               0.0f) {
  const auto address = reinterpret_cast<std::uintptr_t>(storage_.data());
  data_ = storage_.data() + ((64 - address % 64) % 64) / sizeof(float);
}

SamplePool::SamplePool(const CpuNetworks& networks, int sh_degree, int capacity)
    : capacity_(capacity),
      harmonics_(sh_degree * sh_degree),
      geometry_(networks.colour.front().true_inputs - sh_degree * sh_degree),
      density_(capacity),
      density_gradient_(capacity),
      density_activations_(makeRows(networks.density, capacity)),
      colour_activations_(makeRows(networks.colour, capacity)),
      density_gradients_(makeRows(networks.density, capacity)),
      colour_gradients_(makeRows(networks.colour, capacity)) {
  for (auto* rows : {position_, rgb_, rgb_gradient_}) {
    for (int r = 0; r < 3; ++r) rows[r].assign(capacity, 0.0f);
  }
}

void SamplePool::evaluateDensity(const FieldView& field, int first, int count) {
  forEachTile(first, count, [&](int s, int n) {
    field.kernels->encode(field.grid, x() + s, y() + s, z() + s, n,
                          density_activations_.front().at(s), kStride);
    forwardTile(*field.kernels, field.networks->density, &density_activations_, s, n);
    field.kernels->exponential(density_activations_.back().at(s), density() + s, n);
  });
}

void SamplePool::setColourInput(int column, const float* harmonics, int from) {
  float* out = colour_activations_.front().at(column);
  for (int k = 0; k < harmonics_; ++k, out += kStride) *out = harmonics[k];
  const float* features = density_activations_.back().at(from) + kStride;  // behind the logit
  for (int k = 0; k < geometry_; ++k, out += kStride, features += kStride) *out = *features;
}

void SamplePool::evaluateColour(const FieldView& field, int count) {
  forEachTile(0, count, [&](int s, int n) {
    forwardTile(*field.kernels, field.networks->colour, &colour_activations_, s, n);
    for (int c = 0; c < 3; ++c) {
      field.kernels->sigmoid(colour_activations_.back().at(s) + c * kStride, rgb_[c].data() + s, n);
    }
  });
}

void SamplePool::backward(const FieldView& field, int count,
                          std::vector<std::vector<float>>* weight_gradients) {
  forEachTile(0, count, [&](int s, int n) { backwardTile(field, s, n, weight_gradients); });
}

void SamplePool::backwardTile(const FieldView& field, int first, int count,
                              std::vector<std::vector<float>>* weight_gradients) {
  const std::size_t density_layers = field.networks->density.size();
  float* colour_out = colour_gradients_.back().at(first);
  for (int c = 0; c < 3; ++c) {
    for (int s = 0; s < count; ++s) {  // of the sigmoid
      const float value = rgb_[c][first + s];
      colour_out[c * kStride + s] = rgb_gradient_[c][first + s] * value * (1 - value);
    }
  }
  backwardLayers(*field.kernels, field.networks->colour, colour_activations_, &colour_gradients_,
                 first, count,
                 weight_gradients ? weight_gradients->data() + density_layers : nullptr);

  float* density_out = density_gradients_.back().at(first);
  for (int s = 0; s < count; ++s) {  // of the exponential
    density_out[s] = density_gradient_[first + s] * density_[first + s];
  }
  const float* features = colour_gradients_.front().at(first) + harmonics_ * kStride;
  for (int k = 0; k < geometry_; ++k) {
    std::memcpy(density_out + (1 + k) * kStride, features + k * kStride, sizeof(float) * count);
  }
  backwardLayers(*field.kernels, field.networks->density, density_activations_, &density_gradients_,
                 first, count, weight_gradients ? weight_gradients->data() : nullptr);
}

}  // namespace nerf_pose_refiner
