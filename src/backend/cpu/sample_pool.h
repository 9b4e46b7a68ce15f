// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstddef>
#include <vector>

#include "backend/cpu/cpu_kernels.h"
#include "backend/cpu/cpu_networks.h"

namespace nerf_pose_refiner {

/// Rows of numbers over columns of samples, cut into tiles of kTile columns: what is computed for
/// a tile stays in the near caches. The rows of a tile are kTileStride apart, which is no power of
/// two, so that the rows of a column do not fall into one cache set.
class TiledRows {
 public:
  static constexpr int kTile = 128;
  static constexpr int kTileStride = kTile + 16;

  TiledRows(int rows, int columns);
  TiledRows(TiledRows&&) = default;
  TiledRows& operator=(TiledRows&&) = default;

  /// Row 0 at a column; the next row is kTileStride further.
  float* at(int column) {
    return data_ + static_cast<std::size_t>(column / kTile) * rows_ * kTileStride + column % kTile;
  }
  const float* at(int column) const { return const_cast<TiledRows*>(this)->at(column); }
  int rows() const { return rows_; }

  /// Columns [first, first + count) of one tile.
  KernelRows part(int first, int count) { return {at(first), rows_, count, kTileStride}; }
  ConstKernelRows constPart(int first, int count) const {
    return {at(first), rows_, count, kTileStride};
  }

 private:
  int rows_;
  std::vector<float> storage_;
  float* data_;  ///< into storage_, aligned to a cache line
};

/// The field as the pool needs it: parameters are read, never written.
struct FieldView {
  const CpuKernels* kernels;
  const CpuNetworks* networks;
  KernelGrid grid;
};

/// What the layers of a network compute for many columns, and the gradients of the same.
class NetworkRows {
 public:
  NetworkRows(const std::vector<CpuLayer>& layers, int columns);

  /// All layers for columns of one tile.
  void forward(const CpuKernels& kernels, const std::vector<CpuLayer>& layers, int first,
               int count);

  /// From outputGradient, which is written to, back to inputGradient.
  /// @param weight_gradients of each layer, or null: frozen.
  void backward(const CpuKernels& kernels, const std::vector<CpuLayer>& layers, int first,
                int count, std::vector<float>* weight_gradients);

  TiledRows& input() { return activations_.front(); }
  TiledRows& output() { return activations_.back(); }
  const TiledRows& inputGradient() const { return gradients_.front(); }
  TiledRows& outputGradient() { return gradients_.back(); }

 private:
  std::vector<TiledRows> activations_;  ///< before each layer and behind the last
  std::vector<TiledRows> gradients_;
};

/// Memory for samples and all that is computed for them, by one thread. Columns are samples.
///
/// Forward activations are kept, so that gradients can be carried back through them.
class SamplePool {
 public:
  SamplePool(const CpuNetworks& networks, int sh_degree, int capacity);

  int capacity() const { return capacity_; }

  /// Density of columns [first, first + count) from their positions; first and count are
  /// multiples of kColumnGroup.
  void evaluateDensity(const FieldView& field, int first, int count);

  /// Colour of columns [0, count) from their colour inputs; count is a multiple of kColumnGroup.
  void evaluateColour(const FieldView& field, int count);

  /// Writes a sample's colour input: the harmonics of its ray and the geometry features
  /// in column `from` of the density network's output.
  void setColourInput(int column, const float* harmonics, int from);

  /// From rgbGradient (with respect to the colours) and densityGradient, back to the encoding and
  /// the harmonics, columns [0, count). Colours must be in the samples' own columns.
  /// @param weight_gradients of the density layers then the colour layers, or null: frozen.
  void backward(const FieldView& field, int count,
                std::vector<std::vector<float>>* weight_gradients);

  float* position(int axis) { return position_[axis].data(); }  ///< in N
  float* density() { return density_.data(); }
  const float* rgb(int channel) const { return rgb_[channel].data(); }
  float* rgbGradient(int channel) { return rgb_gradient_[channel].data(); }
  float* densityGradient() { return density_gradient_.data(); }
  const TiledRows& encodingGradient() const { return density_network_.inputGradient(); }
  const TiledRows& colourInputGradient() const { return colour_network_.inputGradient(); }

 private:
  void backwardTile(const FieldView& field, int first, int count,
                    std::vector<std::vector<float>>* weight_gradients);

  int capacity_;
  int harmonics_;  ///< rows of spherical harmonics
  int geometry_;   ///< rows of geometry features
  std::vector<float> position_[3], density_, density_gradient_, rgb_[3], rgb_gradient_[3];
  NetworkRows density_network_, colour_network_;
};

/// Calls body(first, count) for the parts of columns [first, first + count) that lie in one tile.
template <typename Body>
void forEachTile(int first, int count, const Body& body) {
  const int end = first + count;
  while (first < end) {
    const int tile_end = (first / TiledRows::kTile + 1) * TiledRows::kTile;
    const int n = (end < tile_end ? end : tile_end) - first;
    body(first, n);
    first += n;
  }
}

}  // namespace nerf_pose_refiner
