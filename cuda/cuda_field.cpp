// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#include "cuda_field.h"

#include <algorithm>
#include <stdexcept>
#include <string>

#include "engine/ray_march.h"
#include "nerf_pose_refiner/maths/half.h"
#include "nerf_pose_refiner/maths/hash.h"

namespace nerf_pose_refiner {
namespace {

constexpr int kMostWidth = 64, kMostEncoding = 64, kMostGeometry = 15;

void require(bool holds, const char* name, int value, const char* range) {
  if (holds) return;
  throw std::invalid_argument(std::string("the CUDA engine has no kernels for FieldConfig::") +
                              name + " = " + std::to_string(value) + ", only for " + range);
}

/// One layer with its padded size; entry (o, i) of the padded matrix.
class PaddedLayer {
 public:
  PaddedLayer(int inputs, int outputs)
      : inputs_(inputs), outputs_(outputs), values_(static_cast<std::size_t>(inputs) * outputs) {}
  int inputs() const { return inputs_; }
  int outputs() const { return outputs_; }
  float& at(int o, int i) { return values_[static_cast<std::size_t>(o) * inputs_ + i]; }
  float at(int o, int i) const { return values_[static_cast<std::size_t>(o) * inputs_ + i]; }

 private:
  int inputs_, outputs_;
  std::vector<float> values_;
};

/// Reads a network; place(layer, input) says where an input stands among the padded ones.
template <typename Place>
std::vector<PaddedLayer> padNetwork(const float* compact, int inputs, int width, int hidden,
                                    int outputs, int padded_inputs, int padded_width,
                                    int padded_outputs, const Place& place) {
  std::vector<PaddedLayer> layers;
  for (int l = 0; l <= hidden; ++l) {
    const int true_inputs = l == 0 ? inputs : width;
    const int true_outputs = l < hidden ? width : outputs;
    layers.emplace_back(l == 0 ? padded_inputs : padded_width,
                        l < hidden ? padded_width : padded_outputs);
    for (int o = 0; o < true_outputs; ++o) {
      for (int i = 0; i < true_inputs; ++i) {
        layers.back().at(o, l == 0 ? place(i) : i) = *compact++;
      }
    }
  }
  return layers;
}

std::uint32_t halves(float low, float high) {
  return floatToHalf(low) | static_cast<std::uint32_t>(floatToHalf(high)) << 16;
}

/// Appends the tiles of a product whose factor is entry(k, n): K / 16 x N / 8 tiles of 32 lanes.
template <typename Entry>
void appendTiles(int K, int N, const Entry& entry, std::vector<WeightPair>* tiles) {
  for (int k0 = 0; k0 < K; k0 += 16) {
    for (int n0 = 0; n0 < N; n0 += 8) {
      for (int lane = 0; lane < 32; ++lane) {
        const int n = n0 + lane / 4, k = k0 + 2 * (lane % 4);
        tiles->push_back(
            {halves(entry(k, n), entry(k + 1, n)), halves(entry(k + 8, n), entry(k + 9, n))});
      }
    }
  }
}

void appendForward(const std::vector<PaddedLayer>& layers, std::vector<WeightPair>* tiles) {
  for (const PaddedLayer& layer : layers) {
    appendTiles(
        layer.inputs(), layer.outputs(), [&](int k, int n) { return layer.at(n, k); }, tiles);
  }
}

/// The way back: last layer first, its gradients padded to 16.
void appendBackward(const std::vector<PaddedLayer>& layers, std::vector<WeightPair>* tiles) {
  for (std::size_t l = layers.size(); l-- > 0;) {
    const PaddedLayer& layer = layers[l];
    const int K = std::max(16, layer.outputs());
    appendTiles(
        K, layer.inputs(),
        [&](int k, int n) { return k < layer.outputs() ? layer.at(k, n) : 0.0f; }, tiles);
  }
}

}  // namespace

CudaNetworkShape cudaNetworkShape(const FieldConfig& config) {
  const int encoding = config.levels * config.features;
  require(config.features >= 2, "features", config.features, "2, 4 and 8");
  require(encoding <= kMostEncoding, "levels * features", encoding, "64 and less");
  require(config.density_width <= kMostWidth, "density_width", config.density_width, "64 and less");
  require(config.colour_width <= kMostWidth, "colour_width", config.colour_width, "64 and less");
  require(config.geometry_features <= kMostGeometry, "geometry_features", config.geometry_features,
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

std::vector<WeightPair> packWeights(const FieldConfig& config,
                                    const std::vector<float>& density_weights,
                                    const std::vector<float>& colour_weights) {
  const CudaNetworkShape shape = cudaNetworkShape(config);
  const int harmonics = config.sh_degree * config.sh_degree;
  const std::vector<PaddedLayer> density =
      padNetwork(density_weights.data(), config.levels * config.features, config.density_width,
                 config.density_hidden_layers, 1 + config.geometry_features,
                 16 * shape.encoding_tiles, shape.width, 16, [](int i) { return i; });
  const std::vector<PaddedLayer> colour =
      padNetwork(colour_weights.data(), harmonics + config.geometry_features, config.colour_width,
                 config.colour_hidden_layers, 3, 32, shape.width, 8,
                 [&](int i) { return i < harmonics ? 16 + i : 1 + i - harmonics; });
  std::vector<WeightPair> tiles;
  appendForward(density, &tiles);
  appendForward(colour, &tiles);
  appendBackward(colour, &tiles);
  appendBackward(density, &tiles);
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

CudaField::CudaField(std::shared_ptr<const Field> field, int device, cudaStream_t stream)
    : field_((field->validate(), std::move(field))),
      device_(device),
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
