// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/common/pixel_window.h"
#include "backend/common/scratch_pool.h"
#include "backend/common/training_occupancy.h"
#include "backend/cost_counters.h"
#include "backend/cpu/cpu_field.h"
#include "backend/cpu/cpu_networks.h"
#include "backend/cpu/ray_batch.h"
#include "backend/training.h"
#include "math/training.h"

namespace nerf_pose_refiner {

/// Trains a field on the CPU. Every sum has a fixed order, whatever the number of threads: rays are
/// dealt to a fixed number of slots with gradients of their own, which are added in order; grid
/// entries are owned by their level.
class CpuTrainer : public FieldTrainer {
 public:
  CpuTrainer(const FieldConfig& config, const Box& box, std::vector<TrainingView> views,
             const TrainingPlan& plan, std::shared_ptr<CpuProcessor> processor);

  double step(double progress) override;
  int stepsDone() const override { return steps_; }
  Field finish(const CancellationToken& cancellation) override { return snapshot(cancellation); }
  Field snapshot(const CancellationToken& cancellation) override;

 private:
  /// Numbers and the optimiser's memory of them.
  struct Parameters {
    std::vector<float> values, gradient, first_moment, second_moment;
    explicit Parameters(std::size_t n)
        : values(n), gradient(n), first_moment(n), second_moment(n) {}
  };
  /// Samples whose encodings got a gradient, kept until the grid takes it up.
  struct Block {
    int columns;
    std::vector<float> rows;  ///< x, y, z, then the encoding's rows; [rows][columns]
  };
  /// What a fixed part of a step's rays produces.
  struct Slot {
    std::vector<std::vector<float>> weight_gradients;  ///< density layers, colour layers
    std::vector<Block> blocks;
    std::size_t used_blocks = 0;
    double loss = 0;
    std::uint64_t samples = 0;  ///< of the rays
    CostCounters work;          ///< all of it
    explicit Slot(const CpuNetworks& networks);
  };
  struct TrainingRay {
    float origin[3], direction[3];
    TrainingTarget target;
  };

  void initialiseParameters();
  TrainingRay drawRay(std::uint64_t index) const;
  void runSlot(int slot, int first_ray, int rays);
  bool trainGroup(RayBatch* batch, Slot* slot, std::uint64_t first_ray, int rays);
  void pushEmptySpaceDown(SamplePool* pool, Slot* slot, int slot_index);
  void countForward(std::uint64_t densities, std::uint64_t colours, CostCounters* work) const;
  void countBackward(std::uint64_t columns, CostCounters* work) const;
  void keepEncodingGradient(SamplePool* pool, int columns, Slot* slot);
  void updateGridLevel(int level, float learning_rate);
  void updateNetworks(float learning_rate);
  float learningRate(double progress) const;

  FieldConfig config_;
  Box box_;
  CubeFrame cube_;
  std::vector<TrainingView> views_;
  std::vector<PixelWindow> windows_;  ///< of each view, where the box can be seen
  TrainingPlan plan_;
  std::shared_ptr<CpuProcessor> processor_;

  CpuNetworks networks_;
  Parameters grid_;
  std::vector<std::uint16_t> half_grid_;
  std::vector<Parameters> layers_;  ///< density layers, colour layers, padded
  FieldView view_;
  TrainingOccupancy occupancy_;
  ScratchPool<RayBatch> batches_;
  std::vector<Slot> slots_;
  int steps_ = 0;
  int rays_per_step_;
};

}  // namespace nerf_pose_refiner
