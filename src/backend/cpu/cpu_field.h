// Copyright (c) 2026, the nerf_pose_refiner authors. SPDX-License-Identifier: BSD-3-Clause
#pragma once

#include <memory>
#include <vector>

#include "backend/common/ray_march.h"
#include "backend/common/scratch_pool.h"
#include "backend/cost_counters.h"
#include "backend/cpu/cpu_kernels.h"
#include "backend/cpu/cpu_networks.h"
#include "backend/cpu/ray_batch.h"
#include "backend/cpu/ray_renderer.h"
#include "backend/loaded_field.h"

namespace nerf_pose_refiner {

/// The cube N of a field, for rays given in model units.
struct CubeFrame {
  float origin[3];               ///< corner of the cube in O
  float side;                    ///< [model units]
  float box_min[3], box_max[3];  ///< of what can be occupied, in N

  explicit CubeFrame(const Box& box);
  /// From the cameras on: near is 0.
  MarchSpace space(float step, float cone_angle, const OccupancyMask* mask) const;
  void toCube(const float p_O[3], float p_N[3]) const {
    for (int a = 0; a < 3; ++a) p_N[a] = (p_O[a] - origin[a]) / side;
  }
};

/// A hash-grid field on the CPU.
class CpuField : public RayRenderer {
 public:
  /// @throws std::invalid_argument if the field is not whole (Field::validate).
  CpuField(std::shared_ptr<const Field> field, std::shared_ptr<CpuProcessor> processor);

  const Field& field() const override { return *field_; }

  CostCounters renderRays(RaySpan rays, const RenderOptions& options,
                          RayResult* results) const override;

  CostCounters rayGradients(RaySpan rays, const RenderOptions& options, bool direction_gradient,
                            const RayLoss& loss, RayGradient* gradients) const override;

 private:
  void enter(RaySpan rays, const RenderOptions& options, RayBatch* batch) const;
  void positionGradients(RaySpan rays, bool direction_gradient, RayBatch* batch,
                         RayGradient* gradients) const;
  void addWork(const RayBatch& batch, int rays, CostCounters* work) const;
  void addGradientWork(const RayBatch& batch, CostCounters* work) const;

  std::shared_ptr<const Field> field_;
  CpuNetworks networks_;
  FieldView view_;
  OccupancyMask mask_;
  CubeFrame cube_;

  mutable ScratchPool<RayBatch> batches_;
};

}  // namespace nerf_pose_refiner
