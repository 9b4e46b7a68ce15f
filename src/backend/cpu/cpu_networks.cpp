// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "backend/cpu/cpu_networks.h"

namespace nerf_pose_refiner {
namespace {

int roundUpTo4(int n) { return (n + 3) / 4 * 4; }

std::vector<CpuLayer> makeLayers(const NetworkShape& shape) {
  std::vector<CpuLayer> layers;
  for (int l = 0; l <= shape.hidden_layers; ++l) {
    CpuLayer layer;
    layer.relu = l < shape.hidden_layers;
    layer.true_inputs = l == 0 ? shape.inputs : shape.width;
    layer.true_outputs = layer.relu ? shape.width : shape.outputs;
    layer.inputs = roundUpTo4(layer.true_inputs);
    layer.outputs = roundUpTo4(layer.true_outputs);
    layer.weights.assign(static_cast<std::size_t>(layer.inputs) * layer.outputs, 0.0f);
    layer.transposed = layer.weights;
    layers.push_back(std::move(layer));
  }
  return layers;
}

/// Takes over weights in the compact layout of Field.
void scatterWeights(const float* compact, std::vector<CpuLayer>* layers) {
  for (CpuLayer& layer : *layers) {
    std::vector<float> padded(layer.weights.size(), 0.0f);
    for (int o = 0; o < layer.true_outputs; ++o) {
      for (int i = 0; i < layer.true_inputs; ++i) {
        padded[static_cast<std::size_t>(o) * layer.inputs + i] = *compact++;
      }
    }
    layer.setWeights(padded);
  }
}

double networkFlops(const std::vector<CpuLayer>& layers) {
  double flops = 0;
  for (const CpuLayer& layer : layers) flops += 2.0 * layer.true_inputs * layer.true_outputs;
  return flops;
}

}  // namespace

void CpuLayer::setWeights(const std::vector<float>& padded) {
  weights = padded;
  for (int o = 0; o < outputs; ++o) {
    for (int i = 0; i < inputs; ++i) {
      transposed[static_cast<std::size_t>(i) * outputs + o] =
          weights[static_cast<std::size_t>(o) * inputs + i];
    }
  }
}

CpuNetworks::CpuNetworks(const FieldConfig& config)
    : density(makeLayers(densityNetwork(config))),
      colour(makeLayers(colourNetwork(config))),
      features(config.features),
      encoding_rows(config.levels * config.features) {
  for (const GridLevel& level : gridLevels(config)) {
    levels.push_back({static_cast<std::uint32_t>(level.resolution), level.entries, level.offset,
                      level.hashed ? 1u : 0u});
  }
}

void CpuNetworks::assign(const std::vector<float>& density_weights,
                         const std::vector<float>& colour_weights) {
  scatterWeights(density_weights.data(), &density);
  scatterWeights(colour_weights.data(), &colour);
}

double CpuNetworks::interpolationFlops() const { return 2.0 * gathersPerSample() * features; }

double CpuNetworks::densityFlops() const { return interpolationFlops() + networkFlops(density); }

double CpuNetworks::colourFlops() const { return networkFlops(colour); }

void gatherWeights(const std::vector<CpuLayer>& layers, float* compact) {
  for (const CpuLayer& layer : layers) {
    for (int o = 0; o < layer.true_outputs; ++o) {
      for (int i = 0; i < layer.true_inputs; ++i) {
        *compact++ = layer.weights[static_cast<std::size_t>(o) * layer.inputs + i];
      }
    }
  }
}

}  // namespace nerf_pose_refiner
