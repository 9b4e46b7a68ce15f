// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <cstdint>
#include <memory>

#include "field/field.h"
#include "nerf_pose_refiner/camera.h"
#include "nerf_pose_refiner/cancellation_token.h"
#include "nerf_pose_refiner/image.h"
#include "nerf_pose_refiner/pose.h"

namespace nerf_pose_refiner {

/// A photo to learn from: straight alpha (255 everywhere for a photo without a mask).
struct TrainingView {
  std::shared_ptr<const Image8> rgba;  ///< [h][w][4]
  Camera camera;
  Pose T_O_C;
};

/// Settings of a trainer that do not change from step to step.
struct TrainingPlan {
  int samples_per_step = 1 << 15;  ///< samples along rays in one step, about
  double learning_rate = 1e-2;
  double final_learning_rate_factor = 0.03;  ///< at the end
  /// Cells that can be occupied at all, at the field's occupancy resolution (a dilated visual hull,
  /// say); empty: the whole box.
  OccupancyGrid region;
  bool random_background = true;  ///< composite each ray on a random colour (views with alpha)
  std::uint64_t seed = 1;
};

/// Trains a field a step at a time. Not thread-safe.
class FieldTrainer {
 public:
  virtual ~FieldTrainer() = default;

  /// One step of Adam on a batch of random rays. @param progress of the training, 0..1, by which
  /// the learning rate falls. @return the mean Huber loss of the batch; where a step is only
  /// enqueued, of the last batches that are done.
  virtual double step(double progress) = 0;
  virtual int stepsDone() const = 0;

  /// Ends the training: rebuilds the occupancy grid densely and freezes the parameters.
  virtual Field finish(const CancellationToken& cancellation) = 0;

  /// The field as it is now (for a preview or a test of the quality), with a fresh occupancy grid.
  virtual Field snapshot(const CancellationToken& cancellation) = 0;
};

}  // namespace nerf_pose_refiner
