// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <vector>

#include "backend/common/ray_march.h"
#include "backend/cpu/ray_renderer.h"
#include "backend/cpu/sample_pool.h"

namespace nerf_pose_refiner {

constexpr int kMaxHarmonics = 16;

inline int roundUpToColumnGroup(int n) {
  return (n + kColumnGroup - 1) / kColumnGroup * kColumnGroup;
}

/// A group of rays on their way through a field, and one thread's memory for it. Lengths in units
/// of the cube N.
///
/// Columns of the pool are samples, in the order in which they were taken; those of one ray ascend
/// along it. What a ray sees does not depend on the other rays of its group.
class RayBatch {
 public:
  struct Column {
    int ray;  ///< -1: padding
    RaySample sample;
    float weight;                ///< transmittance in front * opacity
    float transmittance_behind;  ///< its derivative by the thickness; both 0 if it is left out
  };
  /// Sums over a ray's samples.
  struct Sums {
    float rgb[3];
    float alpha;
    float depth;  ///< sum of weight * t
  };

  RayBatch(const CpuNetworks& networks, int sh_degree);

  /// Rays side by side, in N; there are roundUpToColumnGroup(n), and those behind n are ignored.
  struct Rays {
    std::vector<float> origin[3], direction[3];
    std::vector<float> jitter;  ///< of the intervals, [0, 1)
    void resize(int n);
  };

  /// To be filled before `begin`.
  Rays& rays() { return given_; }

  /// Forgets the last rays and starts with the first n of `rays`. Those that meet nothing are seen
  /// to here and cost no more.
  void begin(const FieldView& field, const MarchSpace& space, int n);

  /// Lets every ray that goes on take its next few samples, behind the last columns, and weighs
  /// them. @return false if they do not fit into the pool.
  bool advance(const FieldView& field, float min_transmittance);
  bool finished() const { return active_.empty(); }

  /// Columns taken since the last call are coloured and added to the sums; their memory is free
  /// again. For rendering. @param min_weight lighter ones are left out.
  void addColours(const FieldView& field, float min_weight, Sums* sums);

  /// Takes all samples of all rays, keeps what is computed for them, and fills sums.
  /// @param min_weight lighter ones are left out of the sums (and hide what is behind them still).
  /// @return false if they do not fit into the pool; a single ray is cut off instead.
  bool forward(const FieldView& field, float min_transmittance, float min_weight, Sums* sums);

  /// After forward: from the derivatives of a loss with respect to the sums of every ray, back to
  /// the samples' encodings and harmonics. @param weight_gradients see SamplePool::backward.
  void backward(const FieldView& field, const RayLossGradient* gradients,
                std::vector<std::vector<float>>* weight_gradients);

  SamplePool& pool() { return pool_; }
  const std::vector<Column>& columns() const { return columns_; }

  /// Evaluations since the last call of `begin`.
  std::uint64_t densityEvaluations() const { return density_evaluations_; }
  std::uint64_t colourEvaluations() const { return colour_evaluations_; }

 private:
  struct RayState {
    RayMarcher marcher;
    float origin[3], direction[3];
    float transmittance;
    bool has_harmonics;
    float harmonics[kMaxHarmonics];
  };

  void findFirstSamples(const FieldView& field, const MarchSpace& space, int n);
  const float* harmonicsOf(int r);
  void takeSamples();
  void weighSamples(const FieldView& field, int first, int count, float min_transmittance);

  int sh_degree_;
  SamplePool pool_;
  Rays given_;
  std::vector<std::int32_t> first_;  ///< interval of each ray where the volume may begin, or -1
  std::vector<RayState> rays_;
  std::vector<int> active_;  ///< rays that go on
  std::vector<Column> columns_;
  std::vector<int> coloured_;   ///< columns heavy enough to need a colour
  std::vector<float> passing_;  ///< exp(-density * length) of each column
  std::uint64_t density_evaluations_ = 0, colour_evaluations_ = 0;
};

}  // namespace nerf_pose_refiner
