// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_field.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "backend/common/ray_march.h"
#include "math/hash.h"
#include "network_layers.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kMaxWidth = 64, kMaxEncoding = 64, kMaxGeometry = 15;

void require(bool holds, const char* name, int value, const char* range) {
  if (holds) return;
  throw std::invalid_argument(std::string("the CUDA backend has no kernels for FieldConfig::") +
                              name + " = " + std::to_string(value) + ", only for " + range);
}

/// Calls body(padded place, compact place) for every weight of a field, of which the density
/// network's come first in both.
template <typename Body>
void forEachWeight(const FieldConfig& config, const Body& body) {
  const NetworkLayers layers = {cudaNetworkShape(config)};
  const int harmonics = config.sh_degree * config.sh_degree;
  std::size_t compact = 0;
  for (int l = 0; l < layers.count(); ++l) {
    const bool colour = l > config.density_hidden_layers, first_colour = layers.isFirstColour(l);
    const bool last = l == config.density_hidden_layers || l == layers.count() - 1;
    const int width = colour ? config.colour_width : config.density_width;
    const int inputs = l == 0         ? config.levels * config.features
                       : first_colour ? harmonics + config.geometry_features
                                      : width;
    const int outputs = !last ? width : colour ? 3 : 1 + config.geometry_features;
    for (int o = 0; o < outputs; ++o) {
      for (int i = 0; i < inputs; ++i) {
        const int place = !first_colour ? i : i < harmonics ? 16 + i : 1 + i - harmonics;
        body(static_cast<std::size_t>(layers.offset(l) + o * layers.inputs(l) + place), compact++);
      }
    }
  }
}

}  // namespace

CudaNetworkShape cudaNetworkShape(const FieldConfig& config) {
  const int encoding = config.levels * config.features;
  require(config.features >= 2, "features", config.features, "2, 4 and 8");
  require(encoding <= kMaxEncoding, "levels * features", encoding, "64 and less");
  require(config.density_width <= kMaxWidth, "density_width", config.density_width, "64 and less");
  require(config.colour_width <= kMaxWidth, "colour_width", config.colour_width, "64 and less");
  require(config.geometry_features <= kMaxGeometry, "geometry_features", config.geometry_features,
          "15 and less");
  CudaNetworkShape shape;
  shape.width = std::max(config.density_width, config.colour_width) <= 32 ? 32 : 64;
  shape.encoding_tiles = (encoding + 15) / 16;
  shape.density_hidden = config.density_hidden_layers;
  shape.colour_hidden = config.colour_hidden_layers;
  return shape;
}

CudaCosts cudaCosts(const FieldConfig& config) {
  const std::size_t gathers = 8 * static_cast<std::size_t>(config.levels);
  const std::size_t density =
      2 * gathers * static_cast<std::size_t>(config.features) + 2 * densityWeightCount(config);
  return {static_cast<unsigned>(gathers), static_cast<unsigned>(density),
          static_cast<unsigned>(2 * colourWeightCount(config))};
}

std::vector<float> padWeights(const FieldConfig& config, const std::vector<float>& density_weights,
                              const std::vector<float>& colour_weights) {
  std::vector<float> padded(
      static_cast<std::size_t>(NetworkLayers{cudaNetworkShape(config)}.weights()), 0.0f);
  forEachWeight(config, [&](std::size_t place, std::size_t i) {
    const std::size_t n = density_weights.size();
    padded[place] = i < n ? density_weights[i] : colour_weights[i - n];
  });
  return padded;
}

void compactWeights(const FieldConfig& config, const std::vector<float>& padded,
                    std::vector<float>* density_weights, std::vector<float>* colour_weights) {
  const std::size_t n = densityWeightCount(config);
  density_weights->resize(n);
  colour_weights->resize(colourWeightCount(config));
  forEachWeight(config, [&](std::size_t place, std::size_t i) {
    (i < n ? (*density_weights)[i] : (*colour_weights)[i - n]) = padded[place];
  });
}

std::vector<WeightPair> packWeights(const FieldConfig& config,
                                    const std::vector<float>& density_weights,
                                    const std::vector<float>& colour_weights) {
  const NetworkLayers layers = {cudaNetworkShape(config)};
  const std::vector<float> padded = padWeights(config, density_weights, colour_weights);
  std::vector<WeightPair> tiles;
  for (int i = 0; i < 32 * layers.shape.forwardTiles(); ++i) {
    tiles.push_back(forwardPair(layers, padded.data(), i / 32, i % 32));
  }
  for (int i = 0; i < 32 * layers.shape.backwardTiles(); ++i) {
    tiles.push_back(transposedPair(layers, padded.data(), i / 32, i % 32));
  }
  return tiles;
}

CudaFieldView cudaFieldView(const FieldConfig& config, const Box& box) {
  CudaFieldView view = {};
  view.shape = cudaNetworkShape(config);
  view.level_count = config.levels;
  view.features = config.features;
  view.sh_degree = config.sh_degree;
  view.step = config.step;
  view.cone_angle = config.cone_angle;
  const std::vector<GridLevel> levels = gridLevels(config);
  for (std::size_t l = 0; l < levels.size(); ++l) {
    const GridLevel& level = levels[l];
    const auto side = static_cast<std::uint32_t>(level.resolution) + 1;
    view.levels[l].resolution = static_cast<float>(level.resolution);
    view.levels[l].stride_y = level.hashed ? kHashPrimeY : side;
    view.levels[l].stride_z = level.hashed ? kHashPrimeZ : side * side;
    view.levels[l].mask = level.entries - 1;
    view.levels[l].offset = level.offset;
    view.levels[l].hashed = level.hashed ? 1 : 0;
  }
  const double side = (box.max - box.min).maxCoeff();
  const Eigen::Vector3d corner = 0.5 * (box.min + box.max) - Eigen::Vector3d::Constant(0.5 * side);
  view.side = static_cast<float>(side);
  for (int a = 0; a < 3; ++a) {
    view.origin[a] = static_cast<float>(corner[a]);
    view.box_min[a] = static_cast<float>((box.min[a] - corner[a]) / side);
    view.box_max[a] = static_cast<float>((box.max[a] - corner[a]) / side);
    view.box_O_min[a] = box.min[a];
    view.box_O_max[a] = box.max[a];
  }
  return view;
}

CudaField::CudaField(std::shared_ptr<const Field> field, cudaStream_t stream)
    : field_((field->validate(), std::move(field))),
      view_(cudaFieldView(field_->config, field_->box)),
      costs_(cudaCosts(field_->config)) {
  const std::vector<WeightPair> weights =
      packWeights(field_->config, field_->density_weights, field_->colour_weights);
  weights_.upload(weights, stream);
  grid_.upload(field_->grid, stream);
  view_.grid = grid_.data();
  view_.forward = weights_.data();
  view_.transposed = weights_.data() + static_cast<std::size_t>(view_.shape.forwardTiles()) * 32;
  for (int a = 0; a < 3; ++a) view_.centre[a] = field_->metadata.centre[a];
  view_.diameter = field_->metadata.diameter;
  if (field_->occupancy.resolution > 0) {
    const OccupancyMask mask(field_->occupancy);
    view_.occupancy = mask.view();
    const std::size_t bits = mask.fine().bits.size();
    const auto coarse = static_cast<std::size_t>(mask.coarseResolution());
    std::vector<std::uint8_t> bytes(mask.fine().bits);
    bytes.insert(bytes.end(), mask.distances(), mask.distances() + coarse * coarse * coarse);
    occupancy_.upload(bytes, stream);
    view_.occupancy.bits = occupancy_.data();
    view_.occupancy.distance = occupancy_.data() + bits;
  }
  NPR_CUDA_CHECK(cudaStreamSynchronize(stream));  // what was copied may end here
}

}  // namespace nerf_pose_refiner
