// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <vector>

#include "backend/common/training_occupancy.h"
#include "backend/cost_counters.h"
#include "backend/training.h"
#include "cuda_field.h"
#include "cuda_processor.h"
#include "device_memory.h"
#include "train.h"

namespace nerf_pose_refiner {

/// Trains a field on a CUDA device, by the rules of math/training.h, with halves where the tensor
/// cores multiply and floats everywhere else. Sums are added in no fixed order: trainings from one
/// seed differ by rounding.
///
/// `step` only enqueues, and waits every few steps: the loss that it returns is the mean over the
/// steps up to the last wait since the one before. A step whose gradients are not finite changes
/// nothing, and lowers the scale by which gradients are multiplied.
class CudaTrainer final : public FieldTrainer {
 public:
  /// Uploads the photos.
  /// @throws std::invalid_argument for a shape that the kernels do not have, views that do not show
  /// the box, or a region of another resolution.
  CudaTrainer(const FieldConfig& config, const Box& box, std::vector<TrainingView> views,
              const TrainingPlan& plan, std::shared_ptr<CudaProcessor> processor);
  ~CudaTrainer() override;

  double step(double progress) override;
  int stepsDone() const override { return steps_; }
  Field finish(const CancellationToken& cancellation) override { return snapshot(cancellation); }
  Field snapshot(const CancellationToken& cancellation) override;

 private:
  /// Numbers and the optimiser's memory of them.
  struct Parameters {
    DeviceBuffer<float> values, gradient, first_moment, second_moment;
    /// Enqueues the upload of the values; the rest is zero.
    LearnedNumbers start(const std::vector<float>& from, cudaStream_t stream);
  };

  void uploadPhotos(const std::vector<TrainingView>& views);
  void startParameters();
  void startOccupancy();
  void takeSums();  ///< waits
  OccupancyGrid freezeOccupancy(const CancellationToken& cancellation,
                                std::vector<float>* cell_opacity);
  void addWork(double rays, double samples, double learned);

  FieldConfig config_;
  Box box_;
  TrainingPlan plan_;
  std::shared_ptr<CudaProcessor> processor_;
  CudaFieldView view_;
  CudaCosts costs_;
  TrainingOccupancy cells_;  ///< which cells are evaluated, and what is occupied at first
  TrainingTask task_ = {};
  OccupancyTask occupancy_ = {};
  int steps_ = 0;
  double loss_ = 0;

  CudaStream stream_;
  DeviceBuffer<uchar4> pixels_;
  DeviceBuffer<TrainingCamera> cameras_;
  Parameters table_, weights_;
  DeviceBuffer<std::uint16_t> halves_;
  DeviceBuffer<WeightPair> tiles_;
  DeviceBuffer<TrainingClock> clock_;
  DeviceBuffer<TrainingRay> rays_;
  DeviceBuffer<float4> points_, values_, gradients_;
  DeviceBuffer<unsigned> point_rays_, learned_;
  DeviceBuffer<std::uint32_t> region_, bits_;
  DeviceBuffer<float> density_, seen_, highest_, mean_;
  DeviceBuffer<std::uint8_t> distance_, distance_2_;
  PinnedBuffer<TrainingClock> pinned_clock_;
};

}  // namespace nerf_pose_refiner
