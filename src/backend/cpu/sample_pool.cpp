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

}  // namespace

TiledRows::TiledRows(int rows, int columns)
    : rows_(rows),
      storage_(static_cast<std::size_t>((columns + kTile - 1) / kTile) * rows * kTileStride + 16,
               0.0f) {
  const auto address = reinterpret_cast<std::uintptr_t>(storage_.data());
  data_ = storage_.data() + ((64 - address % 64) % 64) / sizeof(float);
}

NetworkRows::NetworkRows(const std::vector<CpuLayer>& layers, int columns)
    : activations_(makeRows(layers, columns)), gradients_(makeRows(layers, columns)) {}

void NetworkRows::forward(const CpuKernels& kernels, const std::vector<CpuLayer>& layers, int first,
                          int count) {
  for (std::size_t l = 0; l < layers.size(); ++l) {
    kernels.layer(layers[l].weights.data(), activations_[l].constPart(first, count),
                  activations_[l + 1].part(first, count), layers[l].relu);
  }
}

void NetworkRows::backward(const CpuKernels& kernels, const std::vector<CpuLayer>& layers,
                           int first, int count, std::vector<float>* weight_gradients) {
  for (int l = static_cast<int>(layers.size()) - 1; l >= 0; --l) {
    TiledRows& out = gradients_[l + 1];
    if (layers[l].relu) {
      kernels.reluGradient(activations_[l + 1].constPart(first, count), out.part(first, count));
    }
    if (weight_gradients) {
      kernels.layerWeightGradient(out.constPart(first, count),
                                  activations_[l].constPart(first, count),
                                  weight_gradients[l].data());
    }
    kernels.layer(layers[l].transposed.data(), out.constPart(first, count),
                  gradients_[l].part(first, count), false);
  }
}

SamplePool::SamplePool(const CpuNetworks& networks, int sh_degree, int capacity)
    : capacity_(capacity),
      harmonics_(sh_degree * sh_degree),
      geometry_(networks.colour.front().true_inputs - sh_degree * sh_degree),
      density_(capacity),
      density_gradient_(capacity),
      density_network_(networks.density, capacity),
      colour_network_(networks.colour, capacity) {
  for (auto* rows : {position_, rgb_, rgb_gradient_}) {
    for (int r = 0; r < 3; ++r) rows[r].assign(capacity, 0.0f);
  }
}

void SamplePool::evaluateDensity(const FieldView& field, int first, int count) {
  forEachTile(first, count, [&](int s, int n) {
    const float* const at[3] = {position(0) + s, position(1) + s, position(2) + s};
    field.kernels->encode(field.grid, at, density_network_.input().part(s, n));
    density_network_.forward(*field.kernels, field.networks->density, s, n);
    field.kernels->exponential(density_network_.output().at(s), density() + s, n);
  });
}

void SamplePool::setColourInput(int column, const float* harmonics, int from) {
  float* out = colour_network_.input().at(column);
  for (int k = 0; k < harmonics_; ++k, out += kStride) *out = harmonics[k];
  const float* features = density_network_.output().at(from) + kStride;  // behind the logit
  for (int k = 0; k < geometry_; ++k, out += kStride, features += kStride) *out = *features;
}

void SamplePool::evaluateColour(const FieldView& field, int count) {
  forEachTile(0, count, [&](int s, int n) {
    colour_network_.forward(*field.kernels, field.networks->colour, s, n);
    for (int c = 0; c < 3; ++c) {
      field.kernels->sigmoid(colour_network_.output().at(s) + c * kStride, rgb_[c].data() + s, n);
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
  float* colour_out = colour_network_.outputGradient().at(first);
  for (int c = 0; c < 3; ++c) {
    for (int s = 0; s < count; ++s) {  // of the sigmoid
      const float value = rgb_[c][first + s];
      colour_out[c * kStride + s] = rgb_gradient_[c][first + s] * value * (1 - value);
    }
  }
  colour_network_.backward(*field.kernels, field.networks->colour, first, count,
                           weight_gradients ? weight_gradients->data() + density_layers : nullptr);

  float* density_out = density_network_.outputGradient().at(first);
  for (int s = 0; s < count; ++s) {  // of the exponential
    density_out[s] = density_gradient_[first + s] * density_[first + s];
  }
  const float* features = colour_network_.inputGradient().at(first) + harmonics_ * kStride;
  for (int k = 0; k < geometry_; ++k) {
    std::memcpy(density_out + (1 + k) * kStride, features + k * kStride, sizeof(float) * count);
  }
  density_network_.backward(*field.kernels, field.networks->density, first, count,
                            weight_gradients ? weight_gradients->data() : nullptr);
}

}  // namespace nerf_pose_refiner
