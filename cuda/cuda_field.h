// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "device_memory.h"
#include "field/field.h"
#include "field_view.h"
#include "views.h"

namespace nerf_pose_refiner {

/// A field in the memory of a CUDA device, frozen: table and weights as the file stores them, the
/// weights rounded to halves.
class CudaField {
 public:
  /// Copies, and waits for that.
  /// @throws std::invalid_argument if the field is not whole (Field::validate) or of a shape that
  /// the kernels do not have.
  CudaField(std::shared_ptr<const Field> field, cudaStream_t stream);

  const Field& field() const { return *field_; }
  const CudaFieldView& view() const { return view_; }
  const CudaCosts& costs() const { return costs_; }

 private:
  std::shared_ptr<const Field> field_;
  DeviceBuffer<std::uint16_t> grid_;
  DeviceBuffer<WeightPair> weights_;
  DeviceBuffer<std::uint8_t> occupancy_;
  CudaFieldView view_;
  CudaCosts costs_;
};

/// The networks' shape as the kernels pad it.
/// @throws std::invalid_argument naming the setting that the kernels do not have.
CudaNetworkShape cudaNetworkShape(const FieldConfig& config);

/// What samples of a field of this shape cost.
CudaCosts cudaCosts(const FieldConfig& config);

/// Fills what depends on shape and box alone: levels, networks, cube, steps.
CudaFieldView cudaFieldView(const FieldConfig& config, const Box& box);

/// Weights of a field as NetworkLayers has them, and back.
std::vector<float> padWeights(const FieldConfig& config, const std::vector<float>& density_weights,
                              const std::vector<float>& colour_weights);
void compactWeights(const FieldConfig& config, const std::vector<float>& padded,
                    std::vector<float>* density_weights, std::vector<float>* colour_weights);

/// Weights as the tensor cores take them: forward tiles, then the transposed ones.
std::vector<WeightPair> packWeights(const FieldConfig& config,
                                    const std::vector<float>& density_weights,
                                    const std::vector<float>& colour_weights);

}  // namespace nerf_pose_refiner
